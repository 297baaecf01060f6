"""What is compiled where it is first needed, compiled ahead."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from bubbleskin.layout import Layout


class Part(NamedTuple):
    """Something that is compiled: what it is, and what compiles it, or loads it where that was done before."""

    name: str
    compile: Callable[[], object]


def parts() -> list[Part]:
    """All that this computer compiles: simulated bubbles, the firmware's viper functions, and the model of contact."""
    from bubbleskin.sim import devices, jit, kernel
    from bubbleskin.sim.real import kernel as real

    jit.enable()  # importing simulated boards has brought all that there is of the firmware
    modules = [
        Part(f"firmware, {name.rpartition('.')[2]}", partial(jit.compile_module, name)) for name in jit.waiting()
    ]
    return [
        Part("simulated bubbles", kernel.advance),
        Part("sensors", devices.sense),
        Part("real rubber", real.advance),
        *modules,
        Part("contact and planner", _contact),
    ]


def _contact() -> None:
    from bubbleskin.contact.model import CompliantContact
    from bubbleskin.planner.search import plan

    contact = CompliantContact(Layout.hexagon())
    shape = plan([13.0, *[12.0] * 6], contact.layout, contact=contact).shape
    contact.energy(shape.state, shape.pressure)
    contact.height_slope(shape)
