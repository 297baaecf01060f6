"""The studio's server: NiceGUI's pages on an application of our own, behind the guard, on one socket, for one run."""

import asyncio
import contextlib
import errno
import logging
import secrets
import socket
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from nicegui import ui
from nicegui.client import Client
from starlette.staticfiles import StaticFiles

from bubbleskin.browser.messages import WEB
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.studio.desk import Desk
from bubbleskin.studio.files import STATIC
from bubbleskin.studio.guard import Guard
from bubbleskin.studio.owner import Owner
from bubbleskin.studio.page import Page
from bubbleskin.studio.recorder import Recorder

_LAST_WORDS_S = 2
"""Seconds that open connections have at the end."""
LEFT_S = 8.0
"""Seconds without any page after which a studio ends that had one: long after everything has vented."""
_LOOK_S = 0.25


class Studio:
    """A studio: made once in a process, as NiceGUI's pages are; `serve` runs it until `leave` or Ctrl-C.

    Unless it `stays`, for other pages and notifications, it leaves by itself once its last page has been closed. `folder`:
    where its recordings stay; without one they go with it.
    """

    def __init__(self, host: str, port: int, token: str = "", *, stays: bool = False, folder: Path | None = None):
        self.token = token or secrets.token_urlsafe(24)
        self._host = host
        self._stays = stays
        self._socket = _listen(host, port)
        self.port: int = self._socket.getsockname()[1]
        self.owner = Owner(attended=is_attended)
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        self.address = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}"
        self.desk = Desk(self.owner, self.token, self.address, Recorder(self.owner, folder))
        self._server: _Server | None = None

    @property
    def url(self) -> str:
        """The page's address, with the token."""
        return f"{self.address}/?token={self.token}"

    async def serve(self, device: str, ready: Callable[[], None] = lambda: None) -> None:
        """Serve pages for the wristband at the URL `device`; `ready` is called once they can be opened."""
        app = self._application()
        guarded = Guard(app, token=self.token, host=self._host, port=self.port)
        config = uvicorn.Config(
            guarded,
            log_level="warning",
            lifespan="on",
            timeout_graceful_shutdown=_LAST_WORDS_S,
            ws="websockets-sansio",
            server_header=False,
        )
        self._server = _Server(config, self.owner)
        opening = asyncio.create_task(self.owner.open(device))
        serving = asyncio.create_task(self._server.serve([self._socket]))
        watching = asyncio.create_task(self._leave_after_the_last_page())
        notes = _Notes(self.owner)
        logging.getLogger("bubbleskin").addHandler(notes)
        try:
            await opening
            ready()
            await serving
        finally:
            watching.cancel()
            logging.getLogger("bubbleskin").removeHandler(notes)
            await self.owner.close()
            await self.desk.recorder.close()
            self._socket.close()

    def leave(self) -> None:
        """End `serve`, from whatever thread."""
        if self._server:
            self._server.should_exit = True

    async def _leave_after_the_last_page(self) -> None:
        """Leave once there has been a page, and none for a while; what plays meanwhile is played to its end."""
        last = None
        while not self._stays:
            await asyncio.sleep(_LOOK_S)
            now = time.monotonic()
            if is_attended() or (last and self.owner.plays):
                last = now
            elif last and now - last > LEFT_S:
                self.leave()
                return

    def _application(self) -> FastAPI:
        app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        app.mount("/studio", StaticFiles(directory=STATIC))
        app.mount("/array", StaticFiles(directory=WEB))
        owner, desk = self.owner, self.desk

        @app.post("/stop")
        async def stop() -> JSONResponse:
            await owner.stop()
            return _answer(owner.problem)

        @app.post("/vent")
        async def vent() -> JSONResponse:
            await owner.vent()
            return _answer(owner.problem)

        @app.get("/recordings/{name}")
        def recording(name: str) -> Response:
            path = desk.recorder.file(name)
            if path is None:
                return PlainTextResponse("There is no such recording in this run.\n", 404)
            return FileResponse(path, filename=name, headers={"Cache-Control": "no-store"})

        @app.post("/notify")
        async def notify() -> JSONResponse:
            return _answer(desk.notify())

        @app.post("/terrain")
        async def terrain(request: Request, name: str = "") -> JSONResponse:
            return _answer(await desk.upload(name, await request.body()))

        @app.post("/sequence")
        async def upload(request: Request, name: str = "") -> JSONResponse:
            return _answer(await desk.editor.upload(name, await request.body()))

        @app.get("/sequence")
        async def save() -> Response:
            try:
                name, written = desk.editor.saved()
            except BubbleskinError as error:
                return _answer(str(error))
            return Response(
                written,
                media_type="application/json",
                headers={"Content-Disposition": f'attachment; filename="{name}"'},
            )

        @ui.page("/", title="bubbleskin studio")
        def page(tab: str = "live") -> None:
            ui.add_head_html(
                '<link rel="stylesheet" href="/array/palette.css"><link rel="stylesheet" href="/array/array.css">'
                '<link rel="stylesheet" href="/studio/studio.css"><script defer src="/studio/stop.js"></script>'
            )
            Page(desk, tab)

        ui.run_with(
            app,
            title="bubbleskin studio",
            favicon=STATIC / "icon.svg",
            dark=None,
            language="en-US",
            tailwind=False,
            gzip_middleware_factory=None,
            show_welcome_message=False,
            binding_refresh_interval=None,
        )
        return app


def is_attended() -> bool:
    """Whether any page is open."""
    return any(client.has_socket_connection for client in Client.instances.values())


def _answer(problem: str) -> JSONResponse:
    return JSONResponse({"problem": problem}, 409 if problem else 200)


class _Notes(logging.Handler):
    """Shows in the page what the SDK logs as a warning."""

    def __init__(self, owner: Owner):
        super().__init__(logging.WARNING)
        self._owner = owner

    def emit(self, record: logging.LogRecord) -> None:
        self._owner.warn(record.getMessage())


class _Server(uvicorn.Server):
    """Vents at once where it is told to end, and not when the last connection has closed."""

    def __init__(self, config: uvicorn.Config, owner: Owner):
        super().__init__(config)
        self._owner = owner
        self._loop = asyncio.get_running_loop()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._loop.call_soon_threadsafe(lambda: asyncio.ensure_future(self._owner.vent()))
        super().handle_exit(sig, frame)


def _listen(host: str, port: int) -> socket.socket:
    """A socket at `host` and `port`, 0 for a free one."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
    except (OSError, UnicodeError) as error:
        listening.close()
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            raise InvalidInput(f"Port {port} is in use; give another with --port, or 0 for a free one.") from None
        raise InvalidInput(f"Nothing can listen at {host}, port {port}: {error}.") from None
    return listening


def run(
    device: str, host: str, port: int, ready: Callable[[Studio], None], *, stays: bool, folder: Path | None = None
) -> None:
    """Serve until Ctrl-C or, unless it `stays`, the last page is closed; both vent. `ready` is told once pages can be opened.

    `folder`: where recordings stay.
    """
    studio = Studio(host, port, stays=stays, folder=folder)
    with contextlib.suppress(asyncio.CancelledError):
        asyncio.run(studio.serve(device, lambda: ready(studio)))
