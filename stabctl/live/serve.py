"""The server of the page: this machine only, a token in its address, ended by Ctrl-C."""

import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from stabctl.errors import StudyError
from stabctl.model.case import Case

from .commands import Source

if TYPE_CHECKING:
    import uvicorn

    from .points import Points

HOST = "127.0.0.1"


def serve(
    case: Case, load: Source, *, port: int = 0, browser: bool = True, said: Callable[[str], None] = print
) -> None:
    """Serve the page of a case until Ctrl-C.

    Parameters
    ----------
    case : Case
        The system.
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
        If the optional packages are not installed, the port is in use, or the case has no operating point.
    """
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError:
        raise StudyError("The page needs starlette and uvicorn; install them: pip install 'stabctl[live]'.") from None
    from .warm import warm

    token = secrets.token_urlsafe(18)
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(sys.platform != "win32"))
        try:
            listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "it is not a port"
            raise StudyError(f"Port {port} cannot be used: {reason}; choose another with --port.") from None
        port = listening.getsockname()[1]
        running = server(warm(case), load, token, port)
        address = f"http://{HOST}:{port}/{token}/"
        listening.listen()  # a browser that is quicker than the server waits for it
        with suppress(KeyboardInterrupt):
            said(address)
            if browser:
                webbrowser.open(address)
            running.run([listening])


def server(points: "Points", load: Source, token: str, port: int) -> "uvicorn.Server":
    """The server of a page, to be run with a socket."""
    import uvicorn

    from .app import app

    options: Any = {"log_level": "critical", "lifespan": "off", "server_header": False}
    return uvicorn.Server(
        uvicorn.Config(app(points, load, token, port), timeout_graceful_shutdown=1, ws="none", **options)
    )
