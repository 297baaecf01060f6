"""Who may come in: pages, sockets and webhook of one run, for those who have its token, from its own page."""

import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

BODY_MAX = 8 << 20
"""Bytes that a request may bring at most."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
ANYWHERE = ("0.0.0.0", "::")
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
)


class Guard:
    """Stands before the whole application, its sockets included.

    Refused are a Host that is not ours (a name that was bound to this computer by somebody else), another Origin, and
    whoever has not the token. It comes once in the address of the page and is a cookie from then on, or in the header
    `Authorization: Bearer …`; the webhook takes it in its address too, as senders often know nothing else.
    """

    def __init__(self, app: ASGIApp, *, token: str, host: str, port: int):
        self._app = app
        self._token = token
        self._hosts = () if host in ANYWHERE else (*LOOPBACK, host)
        self._port = port

    @property
    def cookie(self) -> str:
        """The cookie's name: browsers tell those of two ports of a computer apart by nothing else."""
        return f"bubbleskin_studio_{self._port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer it with the reason why not."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if scope["type"] == "websocket":
            if refusal:
                await send({"type": "websocket.close", "code": 1008, "reason": refusal})
            else:
                await self._app(scope, receive, send)
        elif refusal:
            await PlainTextResponse(f"{refusal}\n", 403)(scope, receive, send)
        elif entered := self._entered(scope):
            await entered(scope, receive, send)
        else:
            await self._pass(scope, receive, send)

    def _refusal(self, scope: Scope) -> str:
        """Why this request is refused; empty where it is not."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if self._hosts and _name(host) not in self._hosts:
            return f"This studio is not called {host[:100]!r}; open it at the address that `bubbleskin studio` printed."
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host:
            return "A page of another origin asks; only the studio's own pages may."
        if not any(
            secrets.compare_digest(given.encode(), self._token.encode()) for given in self._given(scope, headers)
        ):
            return "The token of this run is missing; open the address that `bubbleskin studio` printed."
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > BODY_MAX:
            return f"That is {length[:20]} bytes; {BODY_MAX >> 20} MiB are the most."
        return ""

    def _given(self, scope: Scope, headers: Headers) -> Iterable[str]:
        """Every token that came with a request."""
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer":
            yield bearer.strip()
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            cookies = SimpleCookie()
        if self.cookie in cookies:
            yield cookies[self.cookie].value
        if scope["type"] == "http" and scope["path"] in ("/", "/notify"):
            yield from (value for name, value in _query(scope) if name == "token")

    def _entered(self, scope: Scope) -> Response | None:
        """The page without the token in its address, where it came with one: addresses are shown, kept and copied."""
        query = _query(scope)
        if scope["path"] != "/" or not any(name == "token" for name, _ in query):
            return None
        rest = urlencode([(name, value) for name, value in query if name != "token"])
        response = RedirectResponse(f"/?{rest}" if rest else "/", 303, {"Cache-Control": "no-store"})
        response.set_cookie(self.cookie, self._token, httponly=True, samesite="lax", path="/")
        return response

    async def _pass(self, scope: Scope, receive: Receive, send: Send) -> None:
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > BODY_MAX:  # it said that it was less
                return {"type": "http.disconnect"}
            return message

        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *_HEADERS]
            await send(message)

        await self._app(scope, counted, headed)


def _name(host: str) -> str:
    """The name in a Host header, without its port."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].lower()


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True)
