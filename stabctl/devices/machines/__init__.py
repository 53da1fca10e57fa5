"""Device models: machines."""
