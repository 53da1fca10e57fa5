"""The site of the documentation: what `mkdocs.yml` calls."""
