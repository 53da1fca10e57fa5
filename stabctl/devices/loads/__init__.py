"""Device models: loads."""
