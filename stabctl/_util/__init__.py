"""General helpers: compilation, files, validation, wording, processor cores."""
