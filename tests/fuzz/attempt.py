"""An input: words of the command line, and the files that they refer to. It is kept as JSON."""

import json
import shutil
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path

from stabctl.io.folder import PACKAGED

CORPUS = Path(__file__).parent / "corpus"


@dataclass(frozen=True)
class Attempt:
    """Words for the command line, in a folder with these files.

    Parameters
    ----------
    target : str
        Its target, which also says how it is run.
    words : list of str
        Words after `stabctl`.
    cases : dict
        Folder -> packaged case that is copied to it.
    files : dict
        Path -> content, written afterwards; None removes the file. Bytes that are no UTF-8 are surrogates.
    """

    target: str
    words: list[str]
    cases: dict[str, str] = field(default_factory=dict)
    files: dict[str, str | None] = field(default_factory=dict)

    def put(self, folder: Path) -> None:
        """Create the files in a folder."""
        for name, case in self.cases.items():
            shutil.copytree(PACKAGED / case, folder / name)
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            if content is not None:
                path.write_bytes(content.encode("utf-8", "surrogateescape"))

    def text(self) -> str:
        """The attempt as JSON."""
        return json.dumps(asdict(self), indent=1) + "\n"

    def save(self, folder: Path, prefix: str = "") -> Path:
        """Keep it under a name of its own."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{prefix}{self.target}-{sha256(self.text().encode()).hexdigest()[:8]}.json"
        path.write_text(self.text())
        return path


def read(path: Path) -> Attempt:
    """An attempt that was kept."""
    return Attempt(**json.loads(path.read_text()))


def corpus() -> list[Path]:
    """Inputs that once failed."""
    return sorted(CORPUS.glob("*.json"))
