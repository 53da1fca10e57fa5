"""Executed notebooks as pages of the site."""

from pathlib import Path


def converted(path: Path) -> dict[str, str | bytes]:
    """The page of a notebook and its figures, by file name."""
    from nbconvert import MarkdownExporter

    text, parts = MarkdownExporter().from_filename(str(path))
    figures = {f"{path.stem}_{name}": data for name, data in parts["outputs"].items()}
    for name in parts["outputs"]:
        text = text.replace(f"]({name})", f"]({path.stem}_{name})")
    return {f"{path.stem}.md": text, **figures}
