"""Helpers without power systems in them: compilation, files, wording, processor cores."""
