"""One vocabulary of injected failures: part and how, and what that does to a simulated board.

`TABLE` is all of it: URLs, `Skin.inject`, `bubbleskin inject` and the page read it. The same words on `sim://`, `micropython://`
and `rp2040://`, because plant and line behind them are the same.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn, Protocol

from bubble_protocol.schema import injection
from bubbleskin import checks
from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.sim.impairment import Impairment

if TYPE_CHECKING:
    from bubbleskin.sim.plant import Plant

PARTS = ("sensor", "fill valve", "vent valve", "tube", "bubble", "supply", "pump", "link", "clock")
OF_BUBBLES = PARTS[:5]
"""Those that each bubble has."""
HOWS = ("off", "stuck", "wrong", "noisy", "slow", "delayed", "intermittent", "missing")
HEALTHY = "healthy"
"""What mends a part again, however it failed."""


@dataclass(frozen=True)
class Failure:
    """What a part does that fails in some way."""

    part: str
    how: str
    meaning: str
    plant: dict[str, float] = field(default_factory=dict)
    """Failures of `Plant.inject`, and their values."""
    figures: dict[str, float] = field(default_factory=dict)
    """Figures of `PlantParameters` or `Supply`, and what they are multiplied by."""
    share: tuple[float, float] | None = None
    """It fails so many s out of so many, instead of all the time."""
    sensor: str = ""
    """How the sensor is late: "lag" or "delay"."""
    line: Impairment | None = None
    """What the line does."""
    pace: float = 1.0
    """Seconds of the host's clock in one of the device's."""
    board: int | None = None
    """What INJECT calls it, where a real board can do it to itself: nothing that lets air in, or keeps it."""


_BLINK = (0.02, 0.2)
LATE_S = 0.05
"""By how much a sensor is late that is slow or delayed."""

TABLE = (
    Failure("sensor", "off", "reads its pull-down, 0 counts", {"sensor_absent": 1.0}, board=injection.SENSOR_MISSING),
    Failure("sensor", "stuck", "says for ever what it says now", {"sensor_stuck": 0.0}, board=injection.SENSOR_STUCK),
    Failure("sensor", "wrong", "says 3 kPa too much", {"sensor_bias": 3e3}, board=injection.SENSOR_HIGH),
    Failure("sensor", "noisy", "1 kPa RMS of noise instead of 50 Pa", figures={"sensor_noise": 20.0}),
    Failure("sensor", "slow", "follows with a time constant of 50 ms", sensor="lag"),
    Failure("sensor", "delayed", "says what there was 50 ms ago", sensor="delay"),
    Failure(
        "sensor", "intermittent", "reads 0 counts for 20 ms, five times a second", {"sensor_absent": 1.0}, share=_BLINK
    ),
    Failure(
        "sensor",
        "missing",
        "as off: the input reads its pull-down",
        {"sensor_absent": 1.0},
        board=injection.SENSOR_MISSING,
    ),
    Failure("fill valve", "off", "has no current: stays shut", {"fill_stuck": -1.0}, board=injection.FILL_SHUT),
    Failure("fill valve", "stuck", "stays open", {"fill_stuck": 1.0}),
    Failure(
        "fill valve",
        "slow",
        "opens and closes after three times its dead times",
        figures={"fill_opening": 3.0, "fill_closing": 3.0},
    ),
    Failure("fill valve", "intermittent", "stays shut for half of each 0.2 s", {"fill_stuck": -1.0}, share=(0.1, 0.2)),
    Failure("fill valve", "missing", "as off: nothing lets air in", {"fill_stuck": -1.0}, board=injection.FILL_SHUT),
    Failure("vent valve", "off", "has no current: stays open", {"vent_stuck": 1.0}, board=injection.VENT_OPEN),
    Failure("vent valve", "stuck", "stays shut", {"vent_stuck": -1.0}),
    Failure(
        "vent valve",
        "slow",
        "opens and closes after three times its dead times",
        figures={"vent_opening": 3.0, "vent_closing": 3.0},
    ),
    Failure(
        "vent valve", "intermittent", "stays open for 20 ms, five times a second", {"vent_stuck": 1.0}, share=_BLINK
    ),
    Failure("vent valve", "missing", "as off: the line is open", {"vent_stuck": 1.0}, board=injection.VENT_OPEN),
    Failure("tube", "off", "has slipped off the bubble's barb: the line is open", {"pop_off": 1.0}),
    Failure("tube", "stuck", "blocked: a thousand times its resistance", figures={"tube_resistance": 1e3}),
    Failure("tube", "slow", "kinked: twenty times its resistance", figures={"tube_resistance": 20.0}),
    Failure("tube", "missing", "as off: the line is open", {"pop_off": 1.0}),
    Failure("bubble", "off", "has slipped off its barb: the line is open", {"pop_off": 1.0}),
    Failure("bubble", "wrong", "has a hole: at 12 mm it loses a fifth of its air a second", {"leak": 1e-6}),
    Failure("bubble", "slow", "gives way slowly: five times the viscosity", figures={"viscosity": 5.0}),
    Failure("bubble", "missing", "as off: the line is open", {"pop_off": 1.0}),
    Failure(
        "supply",
        "off",
        "the reservoir runs empty: no pump, and the dump valve open",
        {"pump_off": 1.0, "dump_stuck": 1.0},
        board=injection.SUPPLY_EMPTY,
    ),
    Failure("supply", "stuck", "its sensor says for ever what it says now", {"supply_stuck": 0.0}),
    Failure("supply", "wrong", "its sensor says 8 kPa too little", {"supply_bias": -8e3}),
    Failure("supply", "noisy", "its sensor has 1 kPa RMS of noise", figures={"supply.sensor_noise": 20.0}),
    Failure(
        "supply",
        "intermittent",
        "its sensor reads 0 counts for 20 ms, five times a second",
        {"supply_absent": 1.0},
        share=_BLINK,
    ),
    Failure(
        "supply",
        "missing",
        "its sensor's input reads its pull-down",
        {"supply_absent": 1.0},
        board=injection.SUPPLY_MISSING,
    ),
    Failure("pump", "off", "brings nothing", {"pump_off": 1.0}, board=injection.PUMP_OFF),
    Failure("pump", "slow", "brings a tenth of its air", figures={"supply.pump_free_flow": 0.1}),
    Failure("pump", "intermittent", "brings nothing for one second of two", {"pump_off": 1.0}, share=(1.0, 2.0)),
    Failure("pump", "missing", "as off: brings nothing", {"pump_off": 1.0}, board=injection.PUMP_OFF),
    Failure("link", "off", "loses everything, both ways", line=Impairment(drop=1.0)),
    Failure("link", "noisy", "damages one frame in ten", line=Impairment(flip=0.1)),
    Failure("link", "delayed", "half of what comes is 30 ms late, and again", line=Impairment(stall=0.5, stall_s=0.03)),
    Failure("link", "intermittent", "now and then nothing comes for 0.3 s", line=Impairment(stall=0.02, stall_s=0.3)),
    Failure("link", "missing", "as off: loses everything", line=Impairment(drop=1.0)),
    Failure("clock", "slow", "the device's crystal is 60 ppm slow, as far as good ones are off", pace=1.0 + 60e-6),
    Failure("clock", "wrong", "the device's clock goes 2 % slow: no crystal does", pace=1.02),
)
_BY_WORDS = {(failure.part, failure.how): failure for failure in TABLE}
_STUCK = {"sensor_stuck": "sensor", "supply_stuck": "supply"}


def part_of(word: object) -> str:
    """The part that a word means: "fill", "fill_valve" and "fill valve" are one; `InvalidInput` where there is none."""
    said = str(word).replace("_", " ").replace("-", " ").strip() if isinstance(word, str) else ""
    found = said + " valve" if said in ("fill", "vent") else said
    if found not in PARTS:
        raise InvalidInput(f"The part is {shown(word)}; give one of {', '.join(PARTS)}.")
    return found


def failure_of(part: str, how: object) -> Failure:
    """What `part` does that fails in this way; `InvalidInput` says in which ways it can."""
    found = _BY_WORDS.get((part, how)) if isinstance(how, str) else None
    if found is None:
        _refuse(part, how)
    return found


def hows(part: str) -> list[str]:
    """The ways in which `part` can fail."""
    return [failure.how for failure in TABLE if failure.part == part]


def on_board(part: str, number: int, how: object, bubbles: int) -> list[tuple[int, int, int]]:
    """INJECTs that make a part of a real board with so many bubbles fail, or mend it. Raises `InvalidInput`."""
    part = part_of(part)
    number = checks.whole("number", number, 0, bubbles - 1) if part in OF_BUBBLES else 0
    own = {failure.how: failure.board for failure in TABLE if failure.part == part and failure.board is not None}
    mended = [(board, number, 0) for board in sorted(set(own.values()))]
    if how == HEALTHY:
        return mended
    asked = failure_of(part, how).how
    if asked in own:
        return [*mended, (own[asked], number, 1)]
    can = f"{asked}; it can make it {', '.join(own)}, and {HEALTHY} again" if own else "fail"
    raise InvalidInput(
        f"A real board cannot make a {part} {can}. Simulated ones can: sim://, micropython:// or rp2040://."
    )


def _refuse(part: str, how: object) -> NoReturn:
    can = hows(part)
    hint = (
        " Tubes that lead elsewhere are an option of the board, tubes=1-4." if (part, how) == ("tube", "wrong") else ""
    )
    raise InvalidInput(f"A {part} cannot be {shown(how)}; it can be {', '.join(can)}, and {HEALTHY} again.{hint}")


class Failing(Protocol):
    """What is needed of a simulated board: its plant, and what its line does."""

    plant: "Plant"
    line: Impairment | None
    clock_pace: float


class Failures:
    """What of `board` has been made to fail with these words."""

    def __init__(self, board: Failing):
        self._board = board
        self._active: dict[tuple[str, int], Failure] = {}

    def inject(self, part: str, number: int, how: str) -> None:
        """Make a part fail, or mend it; another failure of the same part takes the first one's place. Raises `InvalidInput`."""
        part = part_of(part)
        number = number if part in OF_BUBBLES else 0
        failure = None if how == HEALTHY else failure_of(part, how)
        before = self._active.pop((part, number), None)
        if before:
            self._mend(before, number)
        if failure:
            self._active[part, number] = failure
            self._apply(failure, number)

    def _apply(self, failure: Failure, number: int) -> None:
        plant = self._board.plant
        for name, value in failure.plant.items():
            amount = plant.says(number if _STUCK[name] == "sensor" else -1) if name in _STUCK else value
            if failure.share:
                plant.live.blink(name, number, amount, *failure.share)
            else:
                plant.inject(name, number, amount)
        for name, factor in failure.figures.items():
            plant.change(name, number, factor)
        if failure.sensor:
            plant.live.late(number, LATE_S, failure.sensor == "lag")
        if failure.line:
            self._board.line = failure.line
        self._board.clock_pace *= failure.pace

    def _mend(self, failure: Failure, number: int) -> None:
        plant = self._board.plant
        plant.live.forget(number, list(failure.plant), bool(failure.sensor))
        for name in failure.plant:
            plant.inject(name, number, 0.0)
        for name in failure.figures:
            plant.change(name, number, 1.0)
        if failure.line:
            self._board.line = None
        if failure.pace != 1.0:
            self._board.clock_pace = 1.0
