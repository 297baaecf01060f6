"""From a URL to a wristband: serial ports, sockets, and simulated boards."""

import logging
import os
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, unquote, urlsplit

from bubbleskin import boards, checks
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.layout import Layout
from bubbleskin.link.link import run_sync
from bubbleskin.link.serial import SerialTransport, only_attached
from bubbleskin.link.transport import Transport
from bubbleskin.skin import Skin

if TYPE_CHECKING:
    from bubbleskin.sim.board import Simulated

_log = logging.getLogger(__name__)

SIMULATED = ("sim", "micropython", "rp2040")
TIMEOUT_MAX = 3600.0
"""Seconds that a device may be given to answer, at most."""
NETWORK = ("socket", "rfc2217")


def connect(url: str | os.PathLike[str] | None = None, *, timeout: float = 2.0, layout: Layout | None = None) -> Skin:
    """Open a wristband.

    `url`: a serial port (`/dev/ttyACM0`, `COM3`), `socket://host:port`, `rfc2217://host:port`, or a simulated
    board, `sim://BOARD`, `micropython://BOARD` or `rp2040://BOARD`, with options such as `?seed=3&spread=0.1&realtime=1`.
    BOARD is the name of a board, or the path of a board's file such as `sim://boards/pad8.py`.
    None is the only wristband attached. `timeout`: seconds within which the device must answer each request.
    `layout`: where its bubbles are, instead of what the device tells; for firmware that does not.

    Raises `InvalidInput` for a URL that cannot be meant, `LinkError` where nothing can be opened and
    `WrongDevice` where what is there is no wristband.
    """
    patience = _checked(timeout, layout)
    transport, board = open_transport(url)
    opened = run_sync(AsyncSkin.open(transport, patience, simulated=board, layout=layout))
    run_sync(_opened(opened, board is not None))
    return Skin(opened)


async def aconnect(
    url: str | os.PathLike[str] | None = None, *, timeout: float = 2.0, layout: Layout | None = None
) -> AsyncSkin:
    """The same for asyncio: a skin whose methods are coroutines."""
    patience = _checked(timeout, layout)
    transport, board = open_transport(url)
    skin = await AsyncSkin.open(transport, patience, event_loop=True, simulated=board, layout=layout)
    await _opened(skin, board is not None)
    return skin


async def _opened(skin: AsyncSkin, simulated: bool) -> None:
    """Tell what a program before this one has left behind. A board simulated in here has had none, and holds nothing."""
    skin.link.warns = skin.link.transport.blocks
    if simulated:
        return
    try:
        mode = (await skin.state()).mode
    except LinkError:  # whoever asks for something will be told
        return
    if mode in ("active", "holding"):
        _log.warning(
            "A shape stands on %s, of a program that has ended less than a second ago or was killed. It stays while this one "
            "is connected, until show() or vent().",
            skin.link.transport.name,
        )


def open_transport(url: str | os.PathLike[str] | None) -> "tuple[Transport, Simulated | None]":
    """The transport for a URL, and the simulated board behind it where there is one."""
    if url is None:
        return SerialTransport(only_attached()), None
    url = os.fspath(url) if isinstance(url, os.PathLike) else url
    if not isinstance(url, str):
        raise InvalidInput(
            f"The device is {checks.shown(url)}; give a port or a URL as a text, such as 'sim://{boards.DEFAULT}'."
        )
    if not url.strip():
        raise InvalidInput(f"The device's name is empty; give a port or a URL, such as sim://{boards.DEFAULT}.")
    scheme, separator, rest = url.partition("://")
    if scheme.lower() in SIMULATED and separator:
        return _open_simulated(scheme.lower(), rest)
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise InvalidInput(f"{url} is not a port or URL that can be opened: {error}.") from None
    if parts.scheme in SIMULATED:
        raise InvalidInput(f"{url} is not a simulated board; write {parts.scheme}://{boards.DEFAULT}.")
    if parts.scheme in NETWORK and not (parts.hostname and port):
        raise InvalidInput(f"{url} does not name host and port; write {parts.scheme}://host:7707.")
    return SerialTransport(url), None


def _open_simulated(scheme: str, rest: str) -> "tuple[Transport, Simulated]":
    """The board of `scheme://rest`: its name or the path of its file, and options after a question mark."""
    from bubbleskin.sim import open_board

    quoted, _, options = rest.partition("?")
    board = unquote(quoted)
    if "/" in board and not boards.is_file(board):
        raise InvalidInput(
            f"{scheme}://{rest} is not a simulated board; write {scheme}://{boards.DEFAULT}, or the path of a board's file, "
            f"with options after a question mark, such as {scheme}://{boards.DEFAULT}?seed=3."
        )
    pairs = parse_qsl(options, keep_blank_values=True)
    names = [name for name, _ in pairs]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InvalidInput(f"{scheme}://{rest} says {twice[0]} more than once; give it once.")
    return open_board(scheme, board, dict(pairs))


def _checked(timeout: float, layout: Layout | None) -> float:
    """The timeout, where both can be meant."""
    if layout is not None:
        checks.instance("layout", layout, Layout, "a Layout, or None for the one that the device tells")
    return checks.above_zero("timeout", timeout, TIMEOUT_MAX, "s")
