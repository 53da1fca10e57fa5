"""Records of studies in files: JSON, written whole or not at all."""

import json
from collections.abc import Sequence
from pathlib import Path

from stabctl._util import files
from stabctl.errors import StudyError

from .study import Study


def place(script: Path, folder: Path) -> Path:
    """Where the records of a script stand among the reports: sims/omib.py in sims_omib.json."""
    script = script.resolve()
    return folder / f"{script.parent.name}_{script.stem}.json"


def write(path: Path, studies: Sequence[Study]) -> None:
    """Write the records of one script."""
    files.replace(path, json.dumps([s.to_dict() for s in studies], indent=1, ensure_ascii=False))


def read(path: Path) -> tuple[Study, ...]:
    """The records of one script. Raises StudyError where the file is none."""
    try:
        return tuple(map(Study.from_dict, json.loads(path.read_text(encoding="utf-8"))))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StudyError(f"{path.name} holds no records of a study ({error}); run its script again.") from None
