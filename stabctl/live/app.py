"""The routes of the page; every answer depends on the request alone, so that tabs are independent."""

import json
from collections.abc import Callable
from typing import Any

from stabctl.errors import StabctlError, sentence

from . import commands, linear, page, runs, searches, theory
from .commands import Source
from .guard import Guard
from .packing import pack
from .points import Points
from .recording import recording
from .state import read
from .streams import parts

LARGEST = 20_000_000  # bytes of a request: a page to be saved


class Pages:
    """The answers for one case."""

    def __init__(self, points: Points, load: Source) -> None:
        self.points, self.load = points, load

    def run(self, message: Any) -> bytes:
        """The run of a state."""
        return runs.answer(self.points, read(message), self.load)

    def modes(self, message: Any) -> bytes:
        """The modes at a load level, with a gain multiplied."""
        level = read({"level": message.get("level", 100)})
        case, gain = self.points.bare(level).case, (str(message.get("gain", "")), float(message.get("factor", 1.0)))
        found = linear.answer(case, *gain)
        return json.dumps(found | {"copy": commands.of_modes(self.load, case, level.level, *gain)}).encode()

    def theory(self, message: Any) -> bytes:
        """The equal areas and phase plane of a machine."""
        level, machine, clear = read({"level": message.get("level", 100)}), message["machine"], float(message["clear"])
        found = theory.answer(self.points.bare(level).case, None if machine is None else int(machine), clear)
        copy = commands.of_theory(self.load, level.level, found["machine"], clear)
        return json.dumps(found | {"copy": copy}).encode()

    def save(self, message: Any) -> bytes:
        """The page as a file that works offline."""
        return page.saved(recording(self.points, read(message["state"]), self.load, message["results"])).encode()


def app(points: Points, load: Source, token: str, port: int) -> Guard:
    """The application of a case, behind its guard."""
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import Request
    from starlette.responses import JSONResponse, Response, StreamingResponse
    from starlette.routing import Route

    pages = Pages(points, load)

    async def body(request: Request) -> Any:
        if int(request.headers.get("content-length", 0)) > LARGEST:
            raise ValueError
        return json.loads(await request.body())

    def answered(work: Callable[[Any], bytes], kind: str) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            try:
                return Response(await run_in_threadpool(work, await body(request)), media_type=kind)
            except StabctlError as error:
                wrong = {"error": sentence(error)}
            except (ValueError, KeyError, TypeError, AttributeError):
                return Response(status_code=400)
            text = pack(wrong, {}) if kind == BINARY else json.dumps(wrong).encode()
            return Response(text, media_type=kind)

        return answer

    def streamed(work: Callable[..., None]) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            try:
                state = read(await body(request))
            except (StabctlError, ValueError):
                return Response(status_code=400)
            return StreamingResponse(parts(lambda tell: work(pages.points, state, tell)), media_type=LINES)

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


BINARY, LINES = "application/octet-stream", "application/x-ndjson"
