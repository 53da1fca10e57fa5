"""stabctl live: the interactive page of a case."""

from typing import Annotated

import typer

from . import groups, shared
from .grouped import grouped

Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page (0: any that is free).")]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the default browser.")]


@grouped
def live(*, port: Port = 0, browser: Browser = True, case: groups.CaseOptions) -> None:
    """Open a page that simulates while you move the fault, its clearing time, the storage and its control."""
    from stabctl.live.commands import Source
    from stabctl.live.serve import serve

    def said(address: str) -> None:
        shared.console().print(f"{address}\nCtrl-C ends it.", soft_wrap=True)

    serve(case.load(), Source(repr(case.case), (case.case,)), port=port, browser=browser, said=said)
