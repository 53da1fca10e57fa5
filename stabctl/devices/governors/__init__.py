"""Device models: governors."""
