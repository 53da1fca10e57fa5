"""Executed notebooks as pages of the site."""

import re
from pathlib import Path


def converted(path: Path) -> dict[str, str | bytes]:
    """The page of a notebook and its figures, by file name."""
    from nbconvert import MarkdownExporter

    text, parts = MarkdownExporter().from_filename(str(path))
    figures = {f"{path.stem}_{name}": data for name, data in parts["outputs"].items()}
    for name in parts["outputs"]:
        text = text.replace(f"]({name})", f"]({path.stem}_{name})")
    text = re.sub(r"<style scoped>.*?</style>\n?", "", text, flags=re.DOTALL)  # the tables of the site look alike
    text = re.sub(r"<(table|tr) [^>]*>", r"<\1>", text)
    return {f"{path.stem}.md": text, **figures}
