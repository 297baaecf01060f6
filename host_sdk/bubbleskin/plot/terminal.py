"""The live view of a wristband in a terminal: what every bubble does, and how link, clock and supply are."""

from collections import deque

import numpy as np
from numpy.typing import NDArray
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.layout import Layout
from bubbleskin.link.clock import Clock

_BLOCKS = " ▁▂▃▄▅▆▇█"
_HISTORY = 24
_WIDE = 96  # columns of the terminal from which the array from above stands beside the table
_MEDIUM = 72  # from which there is room for the heights' history
_RATE_SPAN = 2.0  # seconds over which the rate is taken

_STYLES = {
    "settled": "green",
    "missed": "magenta",
    "moving": "yellow",
    "stopped": "cyan",
    "fault": "bold red",
    "resting": "dim",
}


class Monitor:
    """Turns states, as they come, into what is drawn; `width` is the terminal's."""

    def __init__(self, url: str, info: Info, layout: Layout):
        self._url = url
        self._info = info
        self._layout = layout
        self._heights: deque[np.ndarray] = deque(maxlen=_HISTORY)
        self._times: deque[float] = deque()
        self._state: State | None = None

    def take(self, state: State) -> None:
        """One more state."""
        self._state = state
        self._heights.append(state.height_mm)
        self._times.append(state.time)
        while state.time - self._times[0] > _RATE_SPAN:
            self._times.popleft()

    @property
    def rate_hz(self) -> float:
        """States a second of device time, lately."""
        span = self._times[-1] - self._times[0] if self._times else 0.0
        return (len(self._times) - 1) / span if span > 0 else 0.0

    def render(self, width: int, clock: Clock | None = None) -> RenderableType:
        """All of it, for a terminal so wide."""
        state = self._state
        if state is None:
            return Text("waiting for telemetry …")
        parts: list[RenderableType] = [self._head(state), self._health(state, clock)]
        if state.board_faults:
            parts.append(Text(f"faults of the board: {', '.join(state.board_faults)}", style="bold red"))
        table = self._table(state, width)
        parts.append(Columns([table, self._top(state)], padding=(0, 3)) if width >= _WIDE else table)
        return Group(*parts)

    def _head(self, state: State) -> Text:
        text = Text.assemble((self._info.board, "bold"), f" at {self._url}, ", (state.mode, "bold"))
        return text.append(f", {state.time:.2f} s since boot")

    def _health(self, state: State, clock: Clock | None) -> Text:
        text = Text(f"{self.rate_hz:.0f} states/s, ")
        text.append(f"{state.lost} lost", style="red" if state.lost else "")
        if state.supply_kpa == state.supply_kpa:
            text.append(f", supply {state.supply_kpa:.1f} kPa")
        if clock is not None and clock.pings:
            text.append(f", round trip {clock.round_trip * 1e3:.1f} ms, clock ± {clock.uncertainty * 1e3:.1f} ms")
        return text

    def _table(self, state: State, width: int) -> Table:
        table = Table(box=None, pad_edge=False, header_style="dim")
        history = width >= _MEDIUM
        for name in ("", "target", "mm", *(("last states",) if history else ()), "kPa", "status"):
            table.add_column(name, justify="left" if name in ("last states", "status") else "right", no_wrap=True)
        for bubble, height in enumerate(state.height_mm):
            status = state.status[bubble]
            doing = Text(status, style=_STYLES.get(status, ""))
            if state.faults[bubble]:
                doing = Text(", ".join(state.faults[bubble]), style="bold red")
            row: list[RenderableType] = [str(bubble), f"{state.target_mm[bubble]:.2f}", f"{height:.2f}"]
            if history:
                row.append(self._line(bubble))
            table.add_row(*row, f"{state.pressure_kpa[bubble]:.2f}", doing)
        return table

    def _line(self, bubble: int) -> str:
        low, high = self._info.height_rest_mm, self._info.height_max_mm
        heights = np.array([heights[bubble] for heights in self._heights])
        steps = np.clip(np.nan_to_num((heights - low) / (high - low)) * 8, 0, 8).round().astype(int)
        return "".join(_BLOCKS[step] for step in steps).ljust(_HISTORY)

    def _top(self, state: State) -> Text:
        ill = frozenset(bubble for bubble, faults in enumerate(state.faults) if faults)
        limits = self._info.height_rest_mm, self._info.height_max_mm
        return from_above(self._layout, state.height_mm, limits, ill)


def from_above(
    layout: Layout,
    heights_mm: NDArray[np.float64],
    limits_mm: tuple[float, float],
    ill: frozenset[int] = frozenset(),
    marked: int | None = None,
) -> Text:
    """The array from above: heights where the bubbles are, brighter the higher; `ill` ones red, the `marked` one underlined."""
    x, y = layout.positions_mm.T
    pitch = layout.pitch_mm
    columns = np.rint((x - x.min()) / pitch * 8).astype(int)
    rows = np.rint((y.max() - y) / pitch * 2).astype(int)
    text = Text()
    for line in range(int(rows.max()) + 1):
        at = 0
        for bubble in sorted(np.flatnonzero(rows == line), key=lambda bubble: columns[bubble]):
            style = f"black on {shade(heights_mm[bubble], limits_mm)}" if bubble not in ill else "white on red"
            text.append(" " * (columns[bubble] - at))
            text.append(f"{heights_mm[bubble]:5.1f} ", style=f"bold underline {style}" if bubble == marked else style)
            at = columns[bubble] + 6
        text.append("\n")
    return text


def shade(height_mm: float, limits_mm: tuple[float, float]) -> str:
    """The colour of a height in a terminal, from blue to orange, brighter the higher."""
    low, high = limits_mm
    share = float(np.nan_to_num(np.clip((height_mm - low) / (high - low), 0, 1)))
    level = round(60 + 195 * share)
    return f"rgb({level},{level // 2},{255 - level})"
