"""The routes of the page; every answer depends on the request alone, so that tabs are independent."""

import json
from collections.abc import Callable
from typing import Any

from stabctl.errors import StabctlError, bug, sentence

from . import commands, linear, page, runs, searches, theory
from .commands import Source
from .guard import Guard
from .packing import pack
from .points import Points
from .recording import recording
from .state import Wrong, number, read
from .streams import Searches

LARGEST = 20_000_000  # bytes of a request: a page to be saved
LONGEST = 3600.0  # cycles   of a fault in the phase plane


class Pages:
    """The answers for one case."""

    def __init__(self, points: Points, load: Source) -> None:
        self.points, self.load = points, load

    def run(self, message: Any) -> bytes:
        """The run of a state."""
        return runs.answer(self.points, read(message), self.load)

    def modes(self, message: dict[str, Any]) -> bytes:
        """The modes at a load level, with a gain multiplied."""
        level, gain = read({"level": message.get("level", 100)}), message.get("gain", "")
        if not isinstance(gain, str):
            raise Wrong
        case, factor = self.points.bare(level).case, number(message, "factor", 1.0)
        found = linear.answer(case, gain, factor)
        return json.dumps(found | {"copy": commands.of_modes(self.load, case, level.level, gain, factor)}).encode()

    def theory(self, message: dict[str, Any]) -> bytes:
        """The equal areas and phase plane of a machine."""
        level, machine = read({"level": message.get("level", 100)}), message.get("machine")
        clear = number(message, "clear", most=LONGEST)
        if machine is not None and type(machine) is not int:
            raise Wrong
        found = theory.answer(self.points.bare(level).case, machine, clear)
        copy = commands.of_theory(self.load, level.level, found["machine"], clear)
        return json.dumps(found | {"copy": copy}).encode()

    def save(self, message: dict[str, Any]) -> bytes:
        """The page as a file that works offline."""
        state = read(message.get("state"))
        return page.saved(recording(self.points, state, self.load, message.get("results"))).encode()


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
            return Response(text, media_type=kind)

        return answer

    def streamed(work: Callable[..., None]) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            try:
                state = read(await body(request))
            except StabctlError:
                raise HTTPException(400) from None
            found = searching.start(lambda tell: work(pages.points, state, tell))
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
                Route(f"{at}/clearing", streamed(searches.critical), methods=["POST"]),
                Route(f"{at}/landscape", streamed(searches.landscape), methods=["POST"]),
                Route(f"{at}/{{name}}", static),
            ]
        ),
        token,
        port,
    )


def _refused(name: str) -> float:
    """NaN and Infinity are not JSON."""
    raise ValueError(name)


FULL = json.dumps({"error": "Many searches are running for other pages; wait until some of them end."}) + "\n"
BINARY, LINES = "application/octet-stream", "application/x-ndjson"
