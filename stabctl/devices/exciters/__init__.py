"""Device models: exciters."""
