"""Device models: converters of generating units."""
