"""Create a virtual environment with pip, even if Python comes without ensurepip (such as Debian's python3)."""

import json
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request
import venv
from pathlib import Path

INDEX = "https://pypi.org/pypi/pip/json"


def main(folder: Path) -> None:
    """Create the environment; download pip from the package index if `ensurepip` is missing."""
    if sys.version_info < (3, 11):  # noqa: UP036
        sys.exit(f"stabctl needs Python 3.11 or newer; this is {sys.version.split()[0]} (set PYTHON=python3.12, say).")
    try:
        import ensurepip  # noqa: F401
    except ImportError:
        venv.create(folder, with_pip=False)
        _fetch_pip(folder / "bin" / "python")
    else:
        venv.create(folder, with_pip=True)


def _fetch_pip(python: Path) -> None:
    try:
        with urllib.request.urlopen(INDEX, timeout=60) as answer:
            files = json.load(answer)["urls"]
        wheel = next(f for f in files if f["packagetype"] == "bdist_wheel")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / wheel["filename"]
            urllib.request.urlretrieve(urllib.parse.urljoin(INDEX, wheel["url"]), path)
            subprocess.run([python, f"{path}/pip", "install", "-q", str(path)], check=True)
    except (OSError, StopIteration, subprocess.CalledProcessError) as error:
        sys.exit(f"Python has no ensurepip and pip cannot be fetched ({error}); install python3-venv and try again.")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
