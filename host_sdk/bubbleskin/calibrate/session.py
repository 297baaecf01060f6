"""A calibration from beginning to end: measure, fit, and let the wristband use what was found."""

import asyncio
import os
from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bubbleskin import boards, checks
from bubbleskin.calibrate.measure import CalibrationProgress, Progress, Wristband, measure
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.result import SelfCalibration
from bubbleskin.device.info import Info
from bubbleskin.device.settings import Setting
from bubbleskin.device.trim import Trim
from bubbleskin.errors import InvalidInput
from bubbleskin.files import path_of
from bubbleskin.link.link import Link

if TYPE_CHECKING:
    from bubbleskin.membrane.table import Table


class Calibrated(Wristband, Protocol):
    """What is needed of an `AsyncSkin` besides: what it has, and how it takes something else."""

    @property
    def link(self) -> Link:
        """Whether it waits in an event loop."""

    async def settings(self) -> dict[str, Setting]:
        """What can be set."""

    async def trim(self) -> Trim:
        """The trim in use."""

    async def read_tables(self) -> "list[Table]":
        """The tables in use."""

    async def upload_tables(self, tables: Any, save: bool = ..., *, anyway: bool = ...) -> None:
        """Use other tables."""

    async def upload_trim(self, trim: Trim, save: bool = ..., *, anyway: bool = ...) -> None:
        """Use another trim."""

    async def save(self) -> Any:
        """Keep what is in use."""


async def calibrate(
    skin: Calibrated,
    bubbles: Iterable[int] | int | None,
    save: bool,
    board: str | os.PathLike[str] | None,
    progress: Progress | None,
    use: bool = True,
) -> SelfCalibration:
    """Measure, fit, and where it is to `use` it, upload what is accepted: until then nothing of the wristband is changed."""
    checks.flag("save", save)
    checks.flag("upload", use)
    if not skin.info.tells_sd:
        raise InvalidInput(
            f"Firmware {skin.info.firmware} has one figure for both valves, which is too few; update it with `bubbleskin flash`."
        )
    chosen = which(bubbles, skin.info.bubbles)
    if progress is not None and not callable(progress):
        raise InvalidInput(
            f"progress is {checks.shown(progress)}; give a function of one CalibrationProgress, or None."
        )
    nominal = Nominal.of(boards.load(skin.info.board if board is None else path_of(board, "the board")))
    atmosphere_kpa = (await skin.settings())["atmosphere_kpa"].value
    zeros = tuple(int(zero) for zero in (await skin.trim()).zero)
    measured = await measure(skin, chosen, progress)
    if progress:
        progress(CalibrationProgress("fitting", tuple(chosen), 1.0))

    def fit() -> SelfCalibration:
        return SelfCalibration.of(skin.info.board, nominal, measured, atmosphere_kpa, zeros)

    # It takes seconds of the processor, for which an event loop would stand still.
    found = await asyncio.to_thread(fit) if skin.link.event_loop else fit()
    if use and found.accepted:
        await upload(skin, found, save)
    return found


def which(bubbles: Iterable[int] | int | None, count: int) -> list[int]:
    """The bubbles that are meant, in order; `InvalidInput` where there is none of that number."""
    if bubbles is None:
        return list(range(count))
    asked = [bubbles] if isinstance(bubbles, int) else checks.several("bubbles", bubbles, "numbers of bubbles, or None")
    found = sorted({checks.whole("bubbles", bubble, 0, count - 1) for bubble in asked})
    if not found:
        raise InvalidInput("bubbles is empty; give numbers of bubbles, or None for all.")
    return found


async def upload(skin: Calibrated, calibration: SelfCalibration, save: bool) -> None:
    """Let the wristband use the figures of all bubbles that were accepted; of the others it keeps what it has."""
    checks.instance("calibration", calibration, SelfCalibration, "what `calibrate` or `SelfCalibration.load` returns")
    checks.flag("save", save)
    if not calibration.accepted:
        raise InvalidInput("No bubble of this calibration was accepted; its report says what to do.")
    tables, trim = merged(calibration, skin.info, await skin.read_tables(), await skin.trim())
    # The verdicts have compared bubbles already, each for itself.
    await skin.upload_trim(trim, anyway=True)
    await skin.upload_tables(tables, anyway=True)
    if save:
        await skin.save()


def merged(
    calibration: SelfCalibration, info: Info, tables: "Sequence[Table]", trim: Trim
) -> "tuple[list[Table], Trim]":
    """Tables and trim of all bubbles, those in use being `tables` and `trim`."""
    count = len(calibration.zero_counts)
    if calibration.board != info.board or count != info.bubbles:
        raise InvalidInput(
            f"The calibration is of a {calibration.board} with {count} bubbles; this is a {info.board} with {info.bubbles}."
        )
    new_tables = list(tables)
    columns = {field.name: np.array(getattr(trim, field.name)) for field in fields(trim)}
    for each in calibration.bubbles:
        if each.figures is None:
            continue
        new_tables[each.bubble] = each.figures.table
        for name, column in columns.items():
            column[each.bubble] = getattr(each.figures, name)
    return new_tables, replace(trim, **columns)
