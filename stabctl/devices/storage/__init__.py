"""Device models: storage."""
