"""One request to an ASGI application, without a server."""

import asyncio
import json


def ask(app, path, message=None, headers=()):
    """Status and content of the answer; a message is sent as JSON."""
    body = b"" if message is None else json.dumps(message).encode()
    given = {"host": "127.0.0.1:8000", "content-length": str(len(body)), **dict(headers)}
    scope = {
        "type": "http",
        "method": "GET" if message is None else "POST",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "headers": [(k.encode(), v.encode()) for k, v in given.items()],
        "http_version": "1.1",
        "scheme": "http",
        "root_path": "",
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 8000),
    }
    sent = []

    async def run():
        asked = asyncio.Event()

        async def receive():
            if asked.is_set():
                await asyncio.sleep(60)
            asked.set()
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(part):
            sent.append(part)

        await app(scope, receive, send)

    asyncio.run(run())
    content = b"".join(part.get("body", b"") for part in sent)
    return sent[0]["status"], content, dict(sent[0]["headers"])
