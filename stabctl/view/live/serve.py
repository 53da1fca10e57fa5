"""The server of the page: this machine only, a token in its address, warm before the page opens."""

import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stabctl._util.errors import StudyError
from stabctl.simulation.simulate import simulate

from . import answers, page
from .commands import Source
from .state import AT, Points

if TYPE_CHECKING:
    import uvicorn


HOST = "127.0.0.1"
PARTS = 5
ENDS = AT + 0.5  # s   of the first simulations


def serve(
    points: Points, load: Source, *, port: int = 0, browser: bool = True, said: Callable[[str], None] = print
) -> None:
    """Serve the page of a case until Ctrl-C.

    Parameters
    ----------
    points : Points
        The system, prepared by `warm`.
    load : Source
        How it was loaded, for the lines that can be copied.
    port : int
        Port of the server; 0 is any that is free.
    browser : bool
        Open the page in the default browser.
    said : callable
        Called with the address.

    Raises
    ------
    StudyError
        If the port is in use.
    """
    token = secrets.token_urlsafe(18)
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(sys.platform != "win32"))
        try:
            listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "it is not a port"
            raise StudyError(f"Port {port} cannot be used: {reason}; choose another with --port.") from None
        port = listening.getsockname()[1]
        address = f"http://{HOST}:{port}/{token}/"
        listening.listen()  # a browser that is quicker than the server waits for it

        def ready() -> None:
            said(address)
            if browser:
                webbrowser.open(address)

        with suppress(KeyboardInterrupt):
            server(points, load, token, port, ready).run([listening])


def warm(points: Points, told: Callable[[float, str], None]) -> Points:
    """The operating points after their first simulations, which compile everything the page needs.

    Calls `told` with the number of parts done, of `PARTS`, and the next one. Raises `StudyError` if the case cannot be
    simulated.
    """
    told(0, "worst fault")
    first = points.first = answers.opening(points)
    told(1, "diagram")
    page.about(points)
    states = first, replace(first, percent=1.0), replace(first, percent=1.0, law="feedback")
    for k, (state, what) in enumerate(zip(states, ("first run", "storage", "feedback"), strict=True)):
        told(k + 2, what)
        simulate(points.of(state), state.contingency, ENDS, control=points.control(state))
    return points


def server(points: Points, load: Source, token: str, port: int, ready: Callable[[], None]) -> "uvicorn.Server":
    """The server of a page, to be run with a socket; `ready` is called as soon as Ctrl-C ends it in order."""
    import uvicorn

    from .app import app

    class Told(uvicorn.Server):
        async def startup(self, sockets: Any = None) -> None:
            await super().startup(sockets)
            ready()

    options: Any = {"log_level": "critical", "lifespan": "off", "server_header": False}
    return Told(uvicorn.Config(app(points, load, token, port), timeout_graceful_shutdown=1, ws="none", **options))
