"""What no page sends, to the real server: an answer in words or the status of a bad request, and it goes on."""

import json
import socket
import threading
import time

import pytest

from stabctl._util.errors import StudyError
from stabctl.view.live import answers, app, commands
from stabctl.view.live.serve import HOST, server
from stabctl.view.live.state import Points

TOKEN = "a-token-of-the-test"
DEEP = b"[" * 100_000
MANY = b"9" * 5000


@pytest.fixture(scope="module")
def port(cases):
    """The port of a running server."""
    with socket.socket() as listening:
        listening.bind((HOST, 0))
        listening.listen()
        port = listening.getsockname()[1]
        running = server(Points(cases("two_area")), commands.Source("", ()), TOKEN, port, lambda: None)
        thread = threading.Thread(target=running.run, args=([listening],))
        thread.start()
        yield port
        running.should_exit = True
        thread.join(20)
        assert not thread.is_alive()


def sent(port, *data):
    """The answer to raw bytes, until the server closes the connection."""
    found = b""
    with socket.create_connection((HOST, port), 20) as line:
        try:
            for part in data:
                line.sendall(part)
        except (BrokenPipeError, ConnectionResetError):
            pass  # it has answered before the end
        while True:
            try:
                part = line.recv(65536)
            except ConnectionResetError:
                return found
            if not part:
                return found
            found += part


def head(port, path, *lines):
    given = (f"POST /{TOKEN}/{path} HTTP/1.1", f"host: {HOST}:{port}", "connection: close", *lines)
    return "\r\n".join([*given, "", ""]).encode()


def posted(port, path, body):
    """Status and content of the answer to a body."""
    found = sent(port, head(port, path, f"content-length: {len(body)}"), body)
    first, _, rest = found.partition(b"\r\n\r\n")
    return int(first.split()[1]), rest


@pytest.mark.parametrize("path", ["run", "modes", "theory", "save", "clearing", "landscape"])
@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b"3",
        b'"text"',
        DEEP,
        b'{"a":' * 100_000,
        MANY,
        b'{"clear": ' + MANY + b', "machine": 1, "level": 100, "state": 3}',
        b'{"clear": NaN, "machine": 1, "factor": NaN, "state": 3}',
        b'{"clear": 1e999, "machine": 1, "factor": 1e999, "state": 3}',
        b'{"clear": "6", "machine": 1, "factor": "2", "state": 3}',
        b'{"clear": [], "machine": [1], "factor": {}, "gain": ["pss.K"], "state": []}',
        b'{"clear": true, "machine": true, "factor": true, "state": true}',
        b"\xff\xfe\x00\xd8",
        b'{"fault": "\xe9", "state": 3}',
    ],
    ids=range(17),
)
def test_a_message_that_no_page_sends_is_a_bad_request_or_answered_in_words(port, path, body):
    status, content = posted(port, path, body)
    assert status == 400 or (status in (200, 422) and b'"error": "' in content and b"bug" not in content), content[:200]


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("modes", {"level": 10**400}),
        ("modes", {"gain": "pss.K", "factor": 10**400}),
        ("theory", {"machine": 10**400, "clear": 6}),
        ("theory", {"machine": 1, "clear": 10**6}),
        ("theory", {"machine": 1, "clear": -6}),
        ("run", {"fault": "7", "percent": 10**400}),
        ("run", {"fault": "7", "megawatts": {"9" * 5000: 1}}),
        ("run", {"fault": "7", "megawatts": {"1": [1]}}),
        ("run", {"fault": "\ud800"}),
        ("run", {"fault": "7" * 100_000}),
        ("run", {"fault": "7", "clear": 999_999}),
    ],
)
def test_extreme_values_are_answered_in_words(port, path, body):
    status, content = posted(port, path, json.dumps(body).encode())
    assert status == 400 or (status in (200, 422) and b'"error": "' in content and b"bug" not in content), content[:300]


@pytest.mark.parametrize(
    "line",
    [
        "GET * HTTP/1.1",
        "OPTIONS * HTTP/1.1",
        "GET  HTTP/1.1",
        "GET",
        "GET / HTTP/9.9",
        "GET //// HTTP/1.1",
        "GET /%ff%00%d8 HTTP/1.1",
        "GET /\xff HTTP/1.1",
        f"GET /{TOKEN} HTTP/1.1",
        f"GET /{TOKEN}/../../etc/passwd HTTP/1.1",
        f"GET /{TOKEN}/%2e%2e%2fpage.html HTTP/1.1",
        f"GET http://evil.example/{TOKEN}/ HTTP/1.1",
        f"CONNECT /{TOKEN}/ HTTP/1.1",
        f"BREW /{TOKEN}/run HTTP/1.1",
        "\0\0\0\0",
        "GET /" + "x" * 100_000 + " HTTP/1.1",
    ],
)
def test_an_odd_request_line_is_refused(port, line):
    found = sent(port, f"{line}\r\nhost: {HOST}:{port}\r\nconnection: close\r\n\r\n".encode("latin-1"))
    assert not found or 300 <= int(found.split()[1]) < 500, found[:200]


def test_a_body_in_parts_is_counted_as_it_comes(port):
    part = b"100000\r\n" + b" " * 0x100000 + b"\r\n"
    whole = head(port, "run", "transfer-encoding: chunked"), *[part] * 21, b"0\r\n\r\n"
    assert sent(port, *whole).split()[1] == b"413"
    less = head(port, "run", "transfer-encoding: chunked"), *[part] * 18, b"0\r\n\r\n"
    assert sent(port, *less).split()[1] == b"400"  # read to its end, and no JSON
    assert posted(port, "run", b" " * 21_000_000)[0] == 413


@pytest.mark.parametrize("error", [ZeroDivisionError("by\nzero"), MemoryError(), KeyError("x"), ValueError("singular")])
@pytest.mark.parametrize("path", ["clearing", "landscape"])
def test_a_search_that_fails_says_so(port, path, error, monkeypatch):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(answers, "clearing_time", fails)
    monkeypatch.setattr(answers, "screen", fails)
    status, content = posted(port, path, b'{"fault": "7"}')
    assert status == 200
    assert f'"error": "{type(error).__name__}: '.encode() in content
    assert b"This is a bug in stabctl" in content


def test_a_run_that_fails_says_so(port, monkeypatch):
    monkeypatch.setattr("stabctl.view.live.answers.simulate", lambda *_, **__: 1 / 0)
    status, content = posted(port, "run", b'{"fault": "7"}')
    assert status == 200
    assert b"ZeroDivisionError: division by zero. This is a bug in stabctl" in content


def test_a_few_searches_run_at_once_and_their_end_makes_room(port, monkeypatch):
    go, begun = threading.Event(), []

    def waits(*_, **__):
        begun.append(1)
        assert go.wait(20)
        raise StudyError("It has waited.")

    monkeypatch.setattr(answers, "clearing_time", waits)
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(posted(port, "clearing", b'{"fault": "7"}')))
        for _ in range(app.MOST)
    ]
    for thread in threads:
        thread.start()
    until = time.monotonic() + 10
    while len(begun) < app.MOST and time.monotonic() < until:
        time.sleep(0.01)
    assert len(begun) == app.MOST
    status, content = posted(port, "clearing", b'{"fault": "7"}')
    assert status == 503
    assert b"Many searches are running" in content
    assert posted(port, "run", b"[]")[0] == 400  # other answers go on
    go.set()
    for thread in threads:
        thread.join(20)
    assert [status for status, content in found if b"It has waited." in content] == [200] * app.MOST
    assert posted(port, "clearing", b'{"fault": "7"}')[0] == 200
