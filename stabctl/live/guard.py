"""Who may talk to the server: only pages that it has served itself, which know its token."""

import secrets
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

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
