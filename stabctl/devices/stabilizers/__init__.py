"""Device models: stabilizers."""
