"""Device models: links between two buses."""
