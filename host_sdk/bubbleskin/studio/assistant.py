"""The calibration assistant of a run: it measures all bubbles or one, and lets the wristband use what is accepted."""

import asyncio
import base64
import io
from collections.abc import Iterable

from bubbleskin.async_skin import AsyncSkin
from bubbleskin.calibrate.measure import CalibrationProgress
from bubbleskin.calibrate.result import BubbleCalibration, SelfCalibration
from bubbleskin.errors import BubbleskinError, DeviceFault, LinkError
from bubbleskin.studio.owner import Owner

ACTIVITY = "calibration"
_EMPTY_S = 8.0
"""Within which a wristband that is vented is empty."""
_DPI = 110


class Assistant:
    """What was found of each bubble in this run, and whether it is used; for all pages."""

    def __init__(self, owner: Owner):
        self._owner = owner
        self.progress: CalibrationProgress | None = None
        """How far the measurement is; None where nothing is measured."""
        self.said = ""
        """What became of the last one, in a sentence."""
        self.wanted: int | None = None
        """The bubble that is to be measured; None for all."""
        self.chosen = 0
        """The bubble whose result is looked at."""
        self._found: dict[int, SelfCalibration] = {}
        self._used: set[int] = set()
        self._pictures: dict[int, str] = {}
        owner.leavers.add(self._leave)

    @property
    def bubbles(self) -> list[int]:
        """Those that were measured."""
        return sorted(self._found)

    def of(self, bubble: int) -> BubbleCalibration:
        """What was found of a bubble that was measured."""
        return self._found[bubble][bubble]

    def is_used(self, bubble: int) -> bool:
        """Whether the wristband uses what was found of a bubble."""
        return bubble in self._used

    @property
    def usable(self) -> list[int]:
        """Bubbles whose figures can be accepted, and are not used yet."""
        return [bubble for bubble in self.bubbles if self.of(bubble).figures and bubble not in self._used]

    def measure(self, bubble: int | None) -> str:
        """Measure one bubble, None for all; why it cannot be, or nothing. Of the wristband nothing is changed by it."""
        try:
            self._owner.lend(lambda skin: self._measure(skin, bubble), ACTIVITY)
        except BubbleskinError as error:
            return str(error)
        self.said = ""
        self.progress = CalibrationProgress("beginning", (), 0.0)
        return ""

    async def _measure(self, skin: AsyncSkin, bubble: int | None) -> None:
        def tell(now: CalibrationProgress) -> None:
            self.progress = now

        try:
            if faults := await skin.faults():
                who = ", ".join(map(str, faults))
                raise DeviceFault(
                    f"Bubbles {who} have faults: see tab Live for causes and remedies, and clear them first."
                )
            found = await skin.calibrate(bubble, upload=False, progress=tell)
        except asyncio.CancelledError:
            self.said = "It was ended before it was done: everything is vented, and the wristband has what it had."
            raise
        except BubbleskinError:
            self.said = "It could not be done; the wristband has what it had."
            raise
        finally:
            self.progress = None
        self.take(found)

    def take(self, found: SelfCalibration) -> None:
        """Have these results, instead of those that there are of the same bubbles."""
        for each in found.bubbles:
            self._found[each.bubble] = found
            self._used.discard(each.bubble)
            self._pictures.pop(each.bubble, None)
        self.chosen = found.bubbles[0].bubble
        self.said = f"Measured in {found.device_s:.0f} s. The wristband has what it had until you accept."

    def accept(self, bubbles: Iterable[int]) -> str:
        """Vent, and let the wristband use and keep what was found of `bubbles`; why it cannot, or nothing."""
        accepted = [bubble for bubble in bubbles if bubble in self.usable]
        if not accepted:
            return "None of these can be accepted: measure again."
        try:
            self._owner.lend(lambda skin: self._accept(skin, accepted), ACTIVITY)
        except BubbleskinError as error:
            return str(error)
        self.said = ""
        return ""

    async def _accept(self, skin: AsyncSkin, bubbles: list[int]) -> None:
        await skin.vent()
        end = asyncio.get_running_loop().time() + _EMPTY_S
        while (await skin.state()).mode != "idle":
            if asyncio.get_running_loop().time() > end:
                raise LinkError("The wristband is not empty yet; accept again once it is.")
            await asyncio.sleep(0.1)
        # Who stops meanwhile waits for it: half of it would be another set.
        await asyncio.shield(self._upload(skin, bubbles))

    async def _upload(self, skin: AsyncSkin, bubbles: list[int]) -> None:
        parts: dict[int, tuple[SelfCalibration, list[int]]] = {}
        for bubble in bubbles:
            found = self._found[bubble]
            parts.setdefault(id(found), (found, []))[1].append(bubble)
        for found, which in parts.values():
            await skin.upload_calibration(found.only(which), save=True)
            self._used.update(which)
        self.said = f"The wristband uses, and keeps, what was found of {_named(bubbles)}."

    def discard(self) -> None:
        """Forget what was found and is not used; the wristband has what it had."""
        self._found.clear()
        self._used.clear()
        self._pictures.clear()
        self.said = ""

    def _leave(self) -> None:
        self.discard()
        self.wanted = None
        self.progress = None

    async def picture(self, bubble: int) -> str:
        """Curve, fit, measurements and band of a bubble, as a PNG in a data URL."""
        if bubble not in self._pictures:
            each = self.of(bubble)
            drawn = await asyncio.to_thread(_draw, each)
            if bubble in self._found and self.of(bubble) is each:
                self._pictures[bubble] = drawn
            return drawn
        return self._pictures[bubble]


def _named(bubbles: list[int]) -> str:
    return f"bubble{'' if len(bubbles) == 1 else 's'} {', '.join(map(str, bubbles))}"


def _draw(each: BubbleCalibration) -> str:
    from bubbleskin.plot.calibration import draw_one

    file = io.BytesIO()
    draw_one(each).savefig(file, format="png", dpi=_DPI)
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
