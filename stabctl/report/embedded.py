"""Pictures inside a page, that grow when touched."""

import base64
import struct
from html import escape
from pathlib import Path

TYPES = {".png": "image/png", ".svg": "image/svg+xml"}
STYLE = """
figure{margin:1.2rem 0}figcaption{font-size:.875rem;margin-top:.4rem}
.picture input{position:absolute;opacity:0;pointer-events:none}
.picture .frame{display:block;overflow-x:auto;background:#fff;border:1px solid var(--line);border-radius:8px;
padding:.5rem;cursor:zoom-in}.picture img{display:block;max-width:100%;height:auto;margin:auto}
.picture input:checked+.frame{cursor:zoom-out}.picture input:checked+.frame img{max-width:none}
.picture input:focus-visible+.frame{outline:3px solid var(--a)}
"""


def picture(file: Path, title: str, alt: str, caption: str = "") -> str:
    """The picture of a file with what is seen and a caption (HTML). Raises OSError where the file cannot be read."""
    data = file.read_bytes()
    source = f"data:{TYPES[file.suffix]};base64,{base64.b64encode(data).decode()}"
    size = ' width="{}" height="{}"'.format(*struct.unpack(">II", data[16:24])) if file.suffix == ".png" else ""
    return (
        f'<label class="picture"><input type="checkbox" aria-label="Enlarge: {escape(title)}"><span class="frame">'
        f'<img src="{source}" alt="{escape(alt)}"{size}></span></label>{caption}'
    )
