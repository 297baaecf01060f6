"""Where the chip's tick goes: emulated cycles by function and by what MicroPython does for it, at rest and under load."""

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from bubbleskin import boards
from bubbleskin.bench.rows import Row
from bubbleskin.bench.rp2040 import boot, burden
from bubbleskin.sim.rp2040.chip import CLOCK_HZ
from bubbleskin.sim.rp2040.profiler import INTERRUPT, Profiler, Stack
from bubbleskin.toolchain.rp2040 import firmware, symbols

REST, LOAD = "at rest", "under load"
TICK = "app: App.tick"
VIPER = "viper"
_SECONDS = {REST: 0.25, LOAD: 0.5}
_HEIGHT_MM = 9.0
_SETTLE_S = 2.0
_US = CLOCK_HZ / 1e6
_LISTED = 16  # functions
_KINDS = (  # what a function of MicroPython's does, by how its name begins
    ("waiting for a bus", ("i2c_", "check_single_timeout_us", "machine_i2c", "mp_machine_i2c", "machine_adc", "adc_")),
    ("USB", ("tud_", "tu_", "usb", "dcd_", "cdc", "mp_usbd", "hw_endpoint", "stdio", "mp_hal_std", "mp_os_dupterm")),
    ("memory", ("gc_", "m_", "mem")),
    (
        "bytecode and its frames",
        ("mp_execute_bytecode", "mp_setup_code_state", "fun_bc_call", "mp_cstack", "decode_uint"),
    ),
    (
        "attributes and names",
        (
            "mp_map_lookup",
            "mp_load_",
            "mp_store_",
            "find_qstr",
            "qstr_",
            "mp_obj_instance",
            "mp_obj_class",
            "module_attr",
        ),
    ),
)
_OTHER = "calls, integers and the rest of MicroPython"


class Profile(NamedTuple):
    """Of a board in a situation.

    `stacks`: µs a tick by functions of ours, from the tick inwards, and the kind of what MicroPython does for the innermost of
    them, which is missing where that is viper. `calls`: of functions in bytecode, a tick.
    """

    board: str
    situation: str
    stacks: dict[Stack, float]
    calls: dict[str, float]

    @property
    def tick_us(self) -> float:
        """Mean time of a whole tick, from its beginning to its last answer."""
        return sum(spent for stack, spent in self.stacks.items() if stack[0] == TICK)

    def by_kind(self) -> dict[str, float]:
        """µs a tick by what the chip does in them."""
        kinds: dict[str, float] = defaultdict(float)
        for stack, spent in self.stacks.items():
            kinds[VIPER if ours(stack[-1]) else stack[-1]] += spent
        return kinds

    def by_function(self) -> list[tuple[str, float, float]]:
        """(function of ours, µs a tick of its own, and with all that it calls), the one that takes most itself first.

        What MicroPython does for a function, its attributes and the frames of what it calls, is the function's own.
        """
        own: dict[str, float] = defaultdict(float)
        whole: dict[str, float] = defaultdict(float)
        for stack, spent in self.stacks.items():
            names = [name for name in stack if ours(name)]
            if names:
                own[names[-1]] += spent
            for name in set(names):
                whole[name] += spent
        return [(name, spent, whole[name]) for name, spent in sorted(own.items(), key=lambda one: -one[1])]


def profiles() -> Iterator[Profile]:
    """Profile every board in every situation."""
    for name in boards.NAMES:
        for situation, seconds in _SECONDS.items():
            yield profile(name, situation, seconds)


def profile(name: str, situation: str, seconds: float) -> Profile:
    """Profile the board `name` for so many emulated seconds, each of which takes a minute."""
    board, skin = boot(name)
    if situation == REST:
        skin.show([_HEIGHT_MM] * len(skin.layout), wait=False, plan=False)
        skin.sleep(_SETTLE_S)
    with Profiler(board.chip, symbols(firmware([name])[name]), name) as profiler:
        if situation == REST:
            skin.sleep(seconds)
        else:
            burden(board, skin, seconds)
    ticks = profiler.seconds / board.tick_s
    stacks: dict[Stack, float] = defaultdict(float)
    for stack, cycles in profiler.cycles.items():
        names = tuple(function for function in stack if ours(function))
        if TICK in names:
            viper = ours(stack[-1]) and stack[-1] not in profiler.calls
            stacks[(*names[names.index(TICK) :], *(() if viper else (kind(stack[-1]),)))] += cycles / _US / ticks
        elif stack == (INTERRUPT,):
            stacks[stack] += cycles / _US / ticks
    return Profile(name, situation, dict(stacks), {name: n / ticks for name, n in profiler.calls.items()})


def rows_of(found: Profile) -> Iterator[Row]:
    """What a tick takes, and the functions that take most of it themselves."""
    yield Row(f"{found.board}, {found.situation}: a whole tick, mean", found.tick_us, "µs emulated")
    for name, own, whole in found.by_function()[:_LISTED]:
        yield Row(f"  {name}: its own, of {whole:.0f} with what it calls", own, "µs emulated")


def ours(name: str) -> bool:
    """Whether `name` is a function of the firmware: file, colon, function."""
    return ": " in name


def kind(name: str) -> str:
    """What the chip does in MicroPython's function `name`."""
    return next((kind for kind, beginnings in _KINDS if name.startswith(beginnings)), _OTHER)
