"""stabctl live: the interactive page of a case."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.view.live.commands import Source

Port = Annotated[int, Option("--port", min=0, max=65535, help="Port of the page (0: any free port).")]
Browser = Annotated[bool, Option("--browser/--no-browser", help="Open the page in the default browser.")]
READ = "dyr", "loads", "machines", "frequency", "missing", "missing_controls", "conventions"  # arguments of `st.load`


def live(
    *, port: Port = 0, browser: Browser = True, controller: options.Controllers = None, case: groups.CaseOptions
) -> None:
    """Open a page that simulates while you move the fault, its clearing time, the storage and its control."""
    from stabctl.view.live.serve import PARTS, serve, warm
    from stabctl.view.live.state import Points

    files = dict(zip(controller or (), shared.controllers(controller), strict=True))
    law = groups.law_of(files.values())
    acting = tuple(name for name, one in files.items() if one is not law)
    of_law = next((name for name, one in files.items() if one is law), "")

    def said(address: str) -> None:
        shared.console().print(f"{address}\nCtrl-C ends it.", soft_wrap=True)

    with shared.progress("preparing the page:", PARTS) as told:
        points = warm(Points(case.load(), [*files.values()]), told)
    serve(points, source(case)._replace(controllers=acting, law=of_law), port=port, browser=browser, said=said)


def source(case: groups.CaseOptions) -> "Source":
    """How the case is loaded, for the lines that the page gives to copy."""
    from stabctl.view.live.commands import Source

    default = groups.CaseOptions(case.case)
    given = {name: getattr(case, name) for name in READ if getattr(case, name) != getattr(default, name)}
    plain = {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}
    python = f"st.load({', '.join([repr(case.case), *(f'{name}={value!r}' for name, value in plain.items())])})"
    words = [case.case]
    for name, value in plain.items():
        words += [f"--{name.replace('_', '-')}", f"{value:g}" if isinstance(value, float) else str(value)]
    if case.motor_share is not None:
        python += f".with_motors({case.motor_share!r})"
        words += ["--motor-share", f"{case.motor_share!r}"]
    for text in case.settings or ():
        path, _, value = text.partition("=")
        python += f".set({{{path.strip()!r}: {value.strip()!r}}})"
        words += ["--set", text]
    for file in case.device or ():
        words += ["--device", file]
    if case.classical:
        python, words = f"{python}.classical()", [*words, "--classical"]
    return Source(python, tuple(words), before="".join(f"st.register({file!r}); " for file in case.device or ()))
