"""The site of the documentation, beside docs/*.md: Python reference, notebooks, scripts, files outside of docs, colors.

The pages in docs are written for a code host. Here their code blocks get titles, scripts stand in full where a page
links to them, and links out of docs lead to copies on the site.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

import models_page  # noqa: E402
from docs_site import interface, notebooks, recorded  # noqa: E402
from stabctl.view.figures.palette import FONTS, LOOK, variables  # noqa: E402

PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md", "README.md": "index.md"}
OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)")  # a link to a file of the repository that is not in docs
TRIED = re.compile(r"^\[!\[([^]]+)\]\(figures/live/time-1280-light\.webp\)\]\(live\.md\)$", re.MULTILINE)
FRAME = (
    r'<iframe class="tried" src="assets/recorded.html" title="\1" loading="lazy"></iframe>'  # in place of its picture
)
DIALOG = 'data-md-component="search" role="dialog"'
SHIM = "https://unpkg.com/iframe-worker/shim"  # Material's search needs it in pages opened from the file system
COLORS = {
    "--md-primary-fg-color": "a",
    "--md-primary-bg-color": "ink",
    "--md-primary-bg-color--light": "soft",
    "--md-accent-fg-color": "b",
    "--md-typeset-a-color": "a",
    "--md-default-fg-color": "ink",
    "--md-default-fg-color--light": "soft",
    "--md-default-bg-color": "paper",
    "--md-code-bg-color": "card",
}  # variable of the theme -> color of the style


def on_files(files: Files, config: Any) -> Files:
    """Add what are no files of docs."""
    added: dict[str, str | bytes] = {"assets/site.css": _css()}
    added["assets/recorded.html"] = recorded.html()
    added |= {f"reference/{stem}.md": interface.page(stem) for stem in interface.PAGES}
    for name in ("CHANGELOG.md", "CONTRIBUTING.md"):
        added[PAGES[name]] = (ROOT / name).read_text("utf-8").replace("](docs/", "](")
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        added |= {f"notebooks/{name}": content for name, content in notebooks.converted(path).items()}
    for file in files.documentation_pages():  # those of notebooks, added above, lie one folder deeper
        added |= {_place(path): _copy(path) for path in OUTSIDE.findall(file.content_string) if path not in PAGES}
    if files.get_file_from_path("models.md") is None:
        added["models.md"] = models_page.page()
    for place, content in added.items():
        files.append(File.generated(config, place, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the recorded page on the front page, write out scripts, turn links to pages of the site.

    Code blocks get the name of their file as title.
    """
    folder = Path(page.file.src_path).parent
    markdown = re.sub(r"^\[`[\w.]+`\]\(([\w/]+\.py)\)$", lambda m: _script(folder / m[1]), markdown, flags=re.MULTILINE)
    markdown = re.sub(r"^(```\w+) exit=\d+$", r"\1", markdown, flags=re.MULTILINE)
    markdown = re.sub(r"^(```\w+) ([\w./-]+)$", r'\1 title="\2"', markdown, flags=re.MULTILINE)
    if TRIED.search(markdown):
        page.meta["hide"] = ["navigation", "toc"]
    markdown = TRIED.sub(
        r'<iframe class="tried" src="assets/recorded.html" title="\1" loading="lazy"></iframe>', markdown
    )
    markdown = re.sub(r"\]\((notebooks/\w+)\.ipynb\)", r"](\1.md)", markdown)
    return markdown if folder.name == "notebooks" else OUTSIDE.sub(lambda m: f"]({_place(m[1])}", markdown)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Take the script that the theme fetches from the network from the assets; name its dialog for screen readers."""
    output = output.replace(DIALOG, f'{DIALOG} aria-label="Search"')
    up = "../" * page.url.count("/")
    return output.replace(SHIM, f"{up}assets/iframe-worker.js")


def on_post_build(config: Any, **_: Any) -> None:
    """Leave out the page for wrong addresses, which only a web server can show, and which fetches that script."""
    (Path(config.site_dir) / "404.html").unlink(missing_ok=True)


def _script(path: Path) -> str:
    return f'```python title="{path}"\n{(ROOT / "docs" / path).read_text("utf-8")}```'


def _place(path: str) -> str:
    """Where the copy of a file of the repository is on the site."""
    return PAGES.get(path) or f"source/{path}{'.md' if path.endswith('.py') else ''}"


def _copy(path: str) -> str | bytes:
    source = (ROOT / path).read_bytes()
    return (
        f'# {Path(path).name}\n\n```python title="{path}"\n{source.decode()}```\n' if path.endswith(".py") else source
    )


def _css() -> str:
    return "\n".join([*_colors(), (Path(__file__).parent / "site.css").read_text("utf-8")])


def _colors() -> Iterator[str]:
    fonts = ", ".join(f'"{name}"' for name in FONTS)
    yield f":root {{--font: {fonts}, sans-serif; --md-text-font: {fonts};}}"
    for name, scheme in (("default", "light"), ("slate", "dark")):
        ours = " ".join(f"{variable}: {LOOK[scheme][color]};" for variable, color in COLORS.items())
        yield f"[data-md-color-scheme={name}] {{{variables(scheme)} {ours}}}"
