"""The routes of the page: who may ask, and answers whole or in parts; every answer depends on the request alone."""

import json
import secrets
from collections.abc import AsyncIterator, Callable
from queue import SimpleQueue
from threading import BoundedSemaphore, Event, Thread
from typing import TYPE_CHECKING, Any

from stabctl._util.errors import StabctlError, bug, sentence

from . import answers, commands, page
from .answers import Tell, pack
from .commands import Source
from .state import Points, Wrong, number, read

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send


LARGEST = 20_000_000  # bytes of a request: a page to be saved
LONGEST = 3600.0  # cycles   of a fault in the phase plane
MOST = 8  # searches at a time, those included that end after their present simulation because the page has left
BINARY, LINES = "application/octet-stream", "application/x-ndjson"
FULL = json.dumps({"error": "Many searches are running for other pages; wait until some of them end."}) + "\n"
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}


class Pages:
    """The answers for one case."""

    def __init__(self, points: Points, load: Source) -> None:
        self.points, self.load = points, load

    def run(self, message: Any) -> bytes:
        """The run of a state."""
        return answers.run_answer(self.points, read(message), self.load)

    def modes(self, message: dict[str, Any]) -> bytes:
        """The modes at a load level, with a gain multiplied."""
        level, gain = read({"level": message.get("level", 100)}), message.get("gain", "")
        if not isinstance(gain, str):
            raise Wrong
        case, factor = self.points.bare(level).case, number(message, "factor", 1.0)
        found = answers.modes_answer(case, gain, factor)
        return json.dumps(found | {"copy": commands.of_modes(self.load, case, level.level, gain, factor)}).encode()

    def theory(self, message: dict[str, Any]) -> bytes:
        """The equal areas and phase plane of a machine."""
        level, machine = read({"level": message.get("level", 100)}), message.get("machine")
        clear = number(message, "clear", most=LONGEST)
        if machine is not None and type(machine) is not int:
            raise Wrong
        case = self.points.bare(level).case
        found = answers.equal_area_answer(case, machine, clear)
        copy = commands.of_theory(self.load, level.level, case.called[found["machine"]], clear)
        return json.dumps(found | {"copy": copy}).encode()

    def save(self, message: dict[str, Any]) -> bytes:
        """The page as a file that works offline."""
        state = read(message.get("state"))
        return page.saved(page.recording(self.points, state, self.load, message.get("results"))).encode()


class Guard:
    """Answers 404 without content to what is not asked under the token, from this machine's name and own origin.

    The check of Host is against names that an attacker lets point to this machine (DNS rebinding), that of Origin and
    Sec-Fetch-Site against other pages in the same browser.
    """

    def __init__(self, app: "ASGIApp", token: str, port: int) -> None:
        self.app, self.token = app, token.encode()
        self.hosts = [f"{name}:{port}".encode() for name in ("127.0.0.1", "localhost")]

    async def __call__(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        """Pass a request on, or answer it with nothing."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        from starlette.datastructures import MutableHeaders
        from starlette.responses import Response

        if scope["type"] != "http" or not self.allows(scope):
            await Response(status_code=404)(scope, receive, send)
            return

        async def sealed(message: "dict[str, object]") -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self.app(scope, receive, sealed)  # type: ignore[arg-type]

    def allows(self, scope: "Scope") -> bool:
        """Whether token, host and origin are right."""
        headers = dict(scope["headers"])
        given = scope["path"].removeprefix("/").partition("/")[0].encode(errors="replace")
        host, origin = headers.get(b"host", b""), headers.get(b"origin")
        known = secrets.compare_digest(given, self.token) and host in self.hosts
        own = origin is None or origin == b"http://" + host
        return known and own and headers.get(b"sec-fetch-site", b"none") in (b"none", b"same-origin")


def app(points: Points, load: Source, token: str, port: int) -> Guard:
    """The application of a case, behind its guard."""
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.exceptions import HTTPException
    from starlette.requests import Request
    from starlette.responses import JSONResponse, Response, StreamingResponse
    from starlette.routing import Route

    pages, searching = Pages(points, load), Searches()

    async def body(request: Request) -> Any:
        found = bytearray()
        async for part in request.stream():
            found += part
            if len(found) > LARGEST:
                raise HTTPException(413)
        try:
            return json.loads(found, parse_constant=_refused)
        except (ValueError, RecursionError):
            raise HTTPException(400) from None

    def answered(work: Callable[[Any], bytes], kind: str) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            message = await body(request)
            try:
                if not isinstance(message, dict):
                    raise Wrong
                return Response(await run_in_threadpool(work, message), media_type=kind)
            except (Wrong, RecursionError):
                raise HTTPException(400) from None
            except StabctlError as error:
                wrong = {"error": sentence(error)}
            except Exception as error:
                wrong = {"error": bug(error)}
            text = pack(wrong, {}) if kind == BINARY else json.dumps(wrong).encode()
            return Response(text, 422 if kind == "text/html" else 200, media_type=kind)

        return answer

    def streamed(work: Callable[..., None]) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            try:
                state = read(await body(request))
            except StabctlError:
                raise HTTPException(400) from None
            found = searching.start(lambda tell: work(pages.points, state, load, tell))
            if found is None:
                return Response(FULL, 503, {"retry-after": "5"}, LINES)
            return StreamingResponse(found, media_type=LINES)

        return answer

    async def start(request: Request) -> Response:
        return Response(page.html(), media_type="text/html")

    async def about(request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(page.about, pages.points))

    async def static(request: Request) -> Response:
        try:
            content, kind = page.file(request.path_params["name"])
        except StabctlError:
            return Response(status_code=404)
        return Response(content, media_type=kind)

    at = f"/{token}"
    return Guard(
        Starlette(
            routes=[
                Route(f"{at}/", start),
                Route(f"{at}/case", about),
                Route(f"{at}/run", answered(pages.run, BINARY), methods=["POST"]),
                Route(f"{at}/modes", answered(pages.modes, "application/json"), methods=["POST"]),
                Route(f"{at}/theory", answered(pages.theory, "application/json"), methods=["POST"]),
                Route(f"{at}/save", answered(pages.save, "text/html"), methods=["POST"]),
                Route(f"{at}/clearing", streamed(answers.critical), methods=["POST"]),
                Route(f"{at}/landscape", streamed(answers.landscape), methods=["POST"]),
                Route(f"{at}/{{name}}", static),
            ]
        ),
        token,
        port,
    )


def _refused(name: str) -> float:
    """NaN and Infinity are not JSON."""
    raise ValueError(name)


class Left(Exception):
    """The page no longer listens."""


class Searches:
    """Searches in threads, a few at a time; a line of JSON for each part of the answer, until the page leaves."""

    def __init__(self) -> None:
        self._room = BoundedSemaphore(MOST)

    def start(self, work: Callable[[Tell], None]) -> AsyncIterator[bytes] | None:
        """Run `work(tell)` in a thread; what it tells. None if too many are running."""
        if not self._room.acquire(blocking=False):
            return None
        told: SimpleQueue[dict[str, Any] | None] = SimpleQueue()
        left = Event()

        def tell(part: dict[str, Any]) -> None:
            if left.is_set():
                raise Left
            told.put(part)

        def run() -> None:
            try:
                work(tell)
            except Left:
                pass
            except StabctlError as error:
                told.put({"error": sentence(error)})
            except Exception as error:
                told.put({"error": bug(error)})
            finally:
                self._room.release()
                told.put(None)

        Thread(target=run, daemon=True).start()
        return _lines(told, left)


async def _lines(told: "SimpleQueue[dict[str, Any] | None]", left: Event) -> AsyncIterator[bytes]:
    """What is told, until it ends or the page leaves."""
    from anyio import to_thread

    try:
        while (part := await to_thread.run_sync(told.get, abandon_on_cancel=True)) is not None:
            yield json.dumps(part).encode() + b"\n"
    finally:
        left.set()
        told.put(None)  # ends the thread that waits, which would delay the end of the server
