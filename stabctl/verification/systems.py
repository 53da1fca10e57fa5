"""The systems that have published numbers: what `systems.toml` says of each, and its data, found or downloaded."""

import tomllib
import urllib.request
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import platformdirs

from stabctl import io
from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.tables import Branch

HERE = Path(__file__).parent
LARGEST = 10_000_000  # bytes of a file
WAIT = 60  # s for a server


class File(NamedTuple):
    """A file with data of a system that must be downloaded."""

    name: str
    url: str
    sha256: str


class System(NamedTuple):
    """What is known of a system.

    Attributes
    ----------
    name, title : str
        Its name here, and in words.
    source : str
        The publication with its table or page.
    case : str
        A packaged case, a file or folder of `cases`, or the name of the first of its files.
    files : tuple of File
        Files that must be downloaded.
    license : str
        Of these files.
    load : mapping
        Options of `load`; a DYR file is one of `cases`.
    set : mapping
        Parameters that the source has otherwise than the data: "genrou.*.D" is that of every GENROU.
    lines : tuple
        Lines that the source has, and its data do not: buses, r, x, b (pu).
    without : tuple of str
        Models in its data that the source leaves out.
    classical : bool
        Whether the machines are classical ones.
    run : mapping
        Options of `Contingency`, and shunts, of the run whose traces `cases/traces` has.
    conventions : str
        What the numbers assume, in words.
    tolerance : mapping
        Largest difference of each quantity, in its unit.
    reason : str
        Why numbers differ by more than their digits.
    """

    name: str
    title: str
    source: str
    case: str
    files: tuple[File, ...] = ()
    license: str = ""
    load: Mapping[str, Any] = {}
    set: Mapping[str, float] = {}
    lines: tuple[tuple[Any, ...], ...] = ()
    without: tuple[str, ...] = ()
    classical: bool = False
    run: Mapping[str, Any] = {}
    conventions: str = ""
    tolerance: Mapping[str, float] = {}
    reason: str = ""

    def read(self, folder: Path) -> Case:
        """The case as the source has it; its downloaded files are in `folder`."""
        path = folder / self.files[0].name if self.files else HERE / "cases" / self.case
        dyr = {"dyr": HERE / "cases" / self.load["dyr"]} if "dyr" in self.load else {}
        case = io.load(path if path.exists() else self.case, **{**self.load, **dyr})
        if self.lines:
            case = replace(case, branches=(*case.branches, *(Branch(*line) for line in self.lines)))
        for model in self.without:
            case = case.without_device(model)
        if self.classical:
            case = case.classical()
        values: dict[str, float] = {}
        for where, value in self.set.items():
            table, key, column = where.split(".")
            keys = case.devices.get(table, ()) if key == "*" else [key]
            values |= {f"{table}.{one}.{column}": value for one in keys}
        return case.set(values) if values else case

    def sentences(self) -> Iterator[str]:
        """Its source, what its numbers assume, and why some differ."""
        yield f"{self.source}."
        if self.conventions:
            yield f"Assumed: {self.conventions}."
        if self.reason:
            yield self.reason


@cache
def systems() -> Mapping[str, System]:
    """Every system by its name, in the order of the file."""
    given = tomllib.loads((HERE / "systems.toml").read_text(encoding="utf-8"))
    found = {}
    for name, own in given["systems"].items():
        about = given["groups"].get(own.pop("group", ""), {}) | own
        wanted = tuple(
            File(called, f"{given['folders'][folder]}/{path}", digest)
            for called, folder, path, digest in about.pop("files", ())
        )
        found[name] = System(**{"name": name, "case": wanted[0].name if wanted else ""} | about | {"files": wanted})
    return found


def folder_of(given: str | Path | None) -> Path:
    """The folder with downloaded files: as given, or in the user's cache."""
    return Path(platformdirs.user_cache_dir("stabctl")) / "verification" if given is None else files.path_of(given)


def present(system: System, folder: Path) -> bool:
    """Whether all of its files are there, with the contents that its numbers were compared with."""
    return all(_whole(folder / one.name, one) for one in system.files)


def _whole(path: Path, wanted: File) -> bool:
    try:
        return sha256(path.read_bytes()).hexdigest() == wanted.sha256
    except OSError:
        return False


def download(system: System, folder: Path) -> None:
    """Download the files of a system that are not there.

    Raises
    ------
    StudyError
        If a file cannot be reached, or is not the one that the numbers were compared with; nothing is written then.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for one in system.files:
        if _whole(folder / one.name, one):
            continue
        try:
            with urllib.request.urlopen(one.url, timeout=WAIT) as answer:
                content = answer.read(LARGEST)
        except (OSError, ValueError) as error:
            raise StudyError(f"{one.url} cannot be downloaded: {error}.") from None
        if sha256(content).hexdigest() != one.sha256:
            raise StudyError(
                f"{one.url} is not the file that the numbers of {system.name} were compared with (its SHA-256 is "
                f"{sha256(content).hexdigest()}, not {one.sha256}); it was not kept."
            )
        files.replace(folder / one.name, content)
