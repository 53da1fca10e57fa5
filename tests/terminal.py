"""What a command writes to the terminal."""

import re


def said(text):
    """The text without the note on compiling, which is there only on the first run on a machine."""
    return re.sub(r"^stabctl: compiling .*\n", "", text, flags=re.MULTILINE)
