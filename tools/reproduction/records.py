"""The records of studies in JSON files."""

import json
from collections.abc import Sequence
from pathlib import Path

from stabctl._util import files
from stabctl.errors import StudyError

from .study import Study


def path_for(script: Path, folder: Path) -> Path:
    """Return where the records of a script are kept: for sims/omib.py, sims_omib.json in the folder."""
    script = script.resolve()
    return folder / f"{script.parent.name}_{script.stem}.json"


def write(path: Path, studies: Sequence[Study]) -> None:
    """Write the records of one script."""
    files.replace(path, json.dumps([s.to_dict() for s in studies], indent=1, ensure_ascii=False))


def read(path: Path) -> tuple[Study, ...]:
    """Return the records of one script. Raises StudyError if the file is missing or damaged."""
    try:
        return tuple(map(Study.from_dict, json.loads(path.read_text(encoding="utf-8"))))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StudyError(f"{path.name} does not contain records of a study ({error}). Run its script again.") from None
