"""Who comes in: requests and sockets straight to the guard, before an application that would answer all of them."""

import pytest

from bubbleskin.studio.guard import BODY_MAX, Guard

TOKEN = "correct-horse"
OURS = "127.0.0.1:8808"
COOKIE = ("cookie", f"bubbleskin_studio_8808={TOKEN}")


async def answers_all(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    taken = 0
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        taken += len(message.get("body", b""))
        if not message.get("more_body"):
            break
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(taken).encode()})


@pytest.fixture
def ask(in_a_loop):
    """`ask(path, *headers, …)`: what comes back, messages of ASGI."""

    def run(path="/", *headers, kind="http", query="", body=(b"",), host="127.0.0.1"):
        sent = []
        scope = {
            "type": kind,
            "method": "GET",
            "path": path,
            "query_string": query.encode(),
            "headers": [(name.encode(), value.encode()) for name, value in ({"host": OURS} | dict(headers)).items()],
        }
        parts = [{"type": "http.request", "body": part, "more_body": True} for part in body]
        parts[-1]["more_body"] = False

        async def receive():
            return parts.pop(0)

        async def send(message):
            sent.append(message)

        in_a_loop(Guard(answers_all, token=TOKEN, host=host, port=8808)(scope, receive, send))
        return sent

    return run


@pytest.fixture
def status(ask):
    """The status of what comes back; None where nothing does."""

    def run(*args, **kwargs):
        sent = ask(*args, **kwargs)
        return sent[0].get("status") if sent else None

    return run


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/stop",
        "/vent",
        "/notify",
        "/sequence",
        "/studio/stop.js",
        "/array/array.js",
        "/recordings/a.csv",
        "/_nicegui/3.18.0/static/nicegui.js",
    ],
)
def test_without_the_token_nothing_is_answered(ask, status, path):
    sent = ask(path)
    assert sent[0]["status"] == 403
    assert b"token of this run is missing" in sent[1]["body"]
    assert status(path, ("cookie", "bubbleskin_studio_8808=correct-hors")) == 403
    assert status(path, ("authorization", "Bearer wrong")) == 403
    assert status(path, ("cookie", f"bubbleskin_studio_9000={TOKEN}")) == 403


@pytest.mark.parametrize(
    "header", [COOKIE, ("authorization", f"Bearer {TOKEN}"), ("authorization", f"bearer  {TOKEN}")]
)
def test_with_the_token_all_is(status, header):
    assert status("/stop", header) == 200


def test_the_address_brings_the_token_once_and_loses_it(ask, status):
    first = ask("/", query=f"token={TOKEN}&tab=pulse")[0]
    headers = dict(first["headers"])
    assert first["status"] == 303
    assert headers[b"location"] == b"/?tab=pulse"
    assert b"HttpOnly" in headers[b"set-cookie"]
    assert b"SameSite=lax" in headers[b"set-cookie"]
    assert status("/", query="token=wrong") == 403


def test_the_address_opens_the_page_and_the_webhook_only(status):
    assert status("/notify", query=f"token={TOKEN}") == 200
    assert status("/stop", query=f"token={TOKEN}") == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:9999", "null", "https://127.0.0.1"])
def test_another_origin_is_refused_even_with_the_token(ask, status, origin):
    assert status("/notify", COOKIE, ("origin", origin)) == 403
    assert ask("/_nicegui_ws/socket.io/", COOKIE, ("origin", origin), kind="websocket")[0]["type"] == "websocket.close"


def test_our_own_origin_is_not(status):
    assert status("/notify", COOKIE, ("origin", f"http://{OURS}")) == 200


def test_sockets_need_the_token_too(ask):
    assert ask("/_nicegui_ws/socket.io/", kind="websocket")[0]["type"] == "websocket.close"
    assert ask("/_nicegui_ws/socket.io/", COOKIE, kind="websocket")[0]["type"] == "websocket.accept"
    refused = ask("/_nicegui_ws/socket.io/", kind="websocket", query=f"token={TOKEN}")
    assert refused[0]["type"] == "websocket.close"


def test_a_name_that_somebody_else_has_bound_to_this_computer_is_refused(status):
    assert status("/", COOKIE, ("host", "evil.example:8808")) == 403
    for name in ("localhost:8808", "[::1]:8808", "127.0.0.1"):
        assert status("/", COOKIE, ("host", name)) == 200
    assert status("/", COOKIE, ("host", "lab-7:8808"), host="0.0.0.0") == 200


@pytest.mark.parametrize("length", [str(BODY_MAX + 1), "-1", "many"])
def test_what_says_that_it_is_too_large_is_refused(status, length):
    assert status("/terrain", COOKIE, ("content-length", length)) == 403


def test_what_is_larger_than_it_says_is_cut_off(ask, status):
    half = b"x" * (BODY_MAX // 2)
    assert status("/terrain", COOKIE, ("content-length", "5"), body=(half, half)) == 200
    assert ask("/terrain", COOKIE, ("content-length", "5"), body=(half, half, b"x")) == []


def test_no_page_shows_it_in_a_frame_or_learns_its_address(ask):
    headers = dict(ask("/", COOKIE)[0]["headers"])
    assert headers[b"x-frame-options"] == b"DENY"
    assert headers[b"referrer-policy"] == b"no-referrer"
