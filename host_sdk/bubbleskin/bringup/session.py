"""A bring-up from its first question to its report."""

import contextlib
import os
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from bubbleskin import boards, checks
from bubbleskin.bringup import verdicts, wires
from bubbleskin.bringup.board import LOW_SHARE, Board
from bubbleskin.bringup.evidence import EmergencyStop
from bubbleskin.bringup.person import Person
from bubbleskin.bringup.questions import Ask, Question
from bubbleskin.bringup.report import BringUp, Step
from bubbleskin.device.trim import Trim
from bubbleskin.errors import BubbleskinError, InvalidInput, LinkError
from bubbleskin.files import path_of

if TYPE_CHECKING:
    from bubbleskin.skin import Skin

Told = Callable[[Step], object]


class _SaidNoError(Exception):
    """Somebody has said no."""


def bring_up(
    skin: "Skin",
    ask: Ask | None = None,
    *,
    save: bool = True,
    board: str | os.PathLike[str] | None = None,
    progress: Told | None = None,
) -> BringUp:
    """Bring up a board that has never run: step by step, and only after each yes.

    Power, emergency stop, sensors at rest, a short pulse of each bubble's valves with it off its barb and one with all on, what
    is swapped, pump and dump valve, one bubble low, all low. A step that finds something is the last, as the next rely on it.

    `ask`: called with each `Question`; returns whether the answer is yes. No, or a `KeyboardInterrupt`, vents and ends it.
    A simulated board does by itself what a yes promises and looks for itself; without `ask` it says yes to all. `save`: whether
    the sensors' zeros are kept for good. `board`: the file of a board of your own. `progress` is told each `Step` as it ends.
    Returns what was found and done, whatever ended it; raises `InvalidInput` for what cannot be meant.
    """
    person = Person(skin.simulated) if skin.simulated else None
    if ask is None and person is None:
        raise InvalidInput("ask is missing; give a function of one Question that returns True for yes.")
    for name, function in (("ask", ask), ("progress", progress)):
        if function is not None:
            checks.function(name, function, "a function of one argument, or None")
    data = boards.load(skin.info.board if board is None else path_of(board, "the board"))
    return Session(skin, data, ask or (lambda _: True), person, progress).run(checks.flag("save", save))


class Session:
    """One bring-up of `skin`."""

    def __init__(self, skin: "Skin", data: ModuleType, ask: Ask, person: Person | None, progress: Told | None):
        self._skin, self._data, self._ask, self._person, self._progress = skin, data, ask, person, progress
        self._board = Board(skin)
        self._pulses = wires.Pulses()
        self._steps: list[tuple[str, str, Callable[[Step], None]]] = [
            ("power", "Power, and the reservoir fills", self.power),
            ("emergency_stop", "The emergency stop", self.emergency_stop),
            ("sensors", "Each sensor's zero and noise", self.sensors),
            ("valves", "Each bubble's valves, and where wires and tubes lead", self.valves),
            ("supply", "Pump and dump valve", self.supply),
            ("one", "One bubble, low", self.one),
            ("all", "All bubbles, low", self.all),
            ("trim", "The sensors' zeros", self.trim),
        ]
        info = skin.info
        titles = tuple(title for _, title, _ in self._steps)
        self.found = BringUp(info.board, info.firmware, info.bubbles, titles)
        self._save = False

    def run(self, save: bool) -> BringUp:
        """All steps, until one finds something or somebody says no; everything is vented at the end."""
        self._save = save
        found = self.found
        try:
            for name, title, do in self._steps:
                step = Step(name, title)
                found.steps.append(step)
                try:
                    do(step)
                    step.done = True
                finally:
                    if self._progress:
                        self._progress(step)
                if step.findings:
                    break
        except (_SaidNoError, KeyboardInterrupt):
            found.ended = f"It was ended at: {found.steps[-1].title}. Everything is vented."
        except LinkError as error:
            found.ended = (
                f"The wristband was lost at: {found.steps[-1].title}. It vents by itself within a second. {error}"
            )
        except BubbleskinError as error:
            found.ended = f"It could not go on at: {found.steps[-1].title}. {error}"
        finally:
            with contextlib.suppress(BubbleskinError):
                self._skin.vent()
        return found

    # ---- asking

    def _go(self, step: Step, text: str, act: str = "", bubble: int | None = None) -> None:
        """Go on only after a yes."""
        question = Question(step.name, text, act, bubble)
        if not self._ask(question):
            raise _SaidNoError
        if self._person:
            self._person.do(question)

    def _look(self, question: Question) -> bool:
        return self._person.look(question) if self._person else bool(self._ask(question))

    # ---- the steps

    def power(self, step: Step) -> None:
        """The supplies, and what the board says of itself."""
        self._go(
            step,
            "Is all power on, of the board, its valves and its pump, all bubbles on their barbs, nobody's arm in it, and a hand "
            "at the emergency stop? Nothing moves yet.",
        )
        low_kpa = self._data.SUPPLY_LOW_PA / 1000
        supply = self._board.await_supply(low_kpa, 10.0)
        health = self._skin.health()
        step.figures = {
            "supply_kpa": round(supply, 2),
            "self_test": health.self_test,
            "untrue_zero": health.untrue_zero,
            "unfilled": health.unfilled,
            "unvented": health.unvented,
            "board_faults": health.board_faults,
            "said": f"{supply:.1f} kPa in the reservoir; self-test {health.self_test.replace('_', ' ')}",
        }
        step.findings = verdicts.power(health, low_kpa)

    def emergency_stop(self, step: Step) -> None:
        """Its loop, released, pressed and released."""
        self._go(step, "Is the emergency stop released?", "release")
        released = self._board.estop()
        self._go(step, "Press the emergency stop, and keep it pressed. Is it pressed?", "press")
        pressed = self._board.estop()
        self._go(step, "Release the emergency stop. Is it released?", "release")
        seen = EmergencyStop(released, pressed, self._board.estop())
        step.figures = vars(seen)
        step.findings = verdicts.emergency_stop(seen)

    def sensors(self, step: Step) -> None:
        """All of them, with everything vented."""
        self._go(step, "Look at the sensors with everything vented, for a second. Does nobody touch the bubbles?")
        seen = self._board.rest()
        zero, noise = np.abs(seen.zero_pa).max(), np.max(seen.noise_pa)
        step.figures = vars(seen) | {"said": f"zeros within {zero:.0f} Pa, noise up to {noise:.0f} Pa RMS"}
        step.findings = verdicts.rest(seen)

    def valves(self, step: Step) -> None:
        """Two pulses for each bubble, and more where they are strange."""
        bubbles = range(self._skin.info.bubbles)
        for bubble in bubbles:
            self._pull(step, bubble, "Its valves then get one short pulse")
            self._pulse((bubble,), bubble, listen=True)
        self._go(
            step,
            "Push all bubbles onto their barbs. Each then gets a short pulse that hardly lifts it, one after the other. "
            "Are all on?",
            "all_on",
        )
        for bubble in bubbles:
            self._pulse((bubble,), None)
        while more := wires.further(self._pulses, bubbles):
            asked, off = more[0]
            if off is not None:
                self._pull(step, off, f"Bubbles {', '.join(map(str, asked))} then get a short pulse at once")
            self._pulse(asked, off)
        if self.found.pulses[-1].off is not None:
            self._go(step, "Push all bubbles onto their barbs. Are all on?", "all_on")
        step.figures = {"said": f"{len(self.found.pulses)} pulses"}
        step.findings = wires.diagnose(self._pulses, bubbles)

    def _pull(self, step: Step, bubble: int, then: str) -> None:
        text = f"Pull bubble {bubble} off its barb, and push all others on. {then}. Is only bubble {bubble} off?"
        self._go(step, text, "pull", bubble)

    def _pulse(self, asked: tuple[int, ...], off: int | None, *, listen: bool = False) -> None:
        pulse = self._board.pulse(asked, off)
        if listen:
            text = f"Did you hear the valves of place {off} click?"
            pulse = pulse.with_heard(self._look(Question("valves", text, "listen", asked[0], look=True)))
        self._pulses.add(pulse)
        self.found.pulses.append(pulse)

    def supply(self, step: Step) -> None:
        """The reservoir with its pump off, and on again."""
        self._go(
            step,
            "Switch the pump off. The bubbles then take air, low, until the board notices and empties the reservoir. Is it off?",
            "pump_off",
        )
        drawn = self._board.draw()
        self._go(step, "Switch the pump on again. Is it on?", "pump_on")
        seen = self._board.refill(*drawn)
        step.figures = vars(seen) | {
            "said": f"emptied to {seen.dumped_kpa:.1f} kPa, full again at {seen.filled_kpa:.1f} kPa in {seen.fill_s:.1f} s"
        }
        step.findings = verdicts.reservoir(seen)

    def one(self, step: Step) -> None:
        """One bubble rises, and somebody says which."""
        self._go(
            step,
            f"Bubble 0 now rises to {self._low:g} mm, for three seconds. Watch which one it is. Are all faces away from it?",
        )
        self._show(step, [0])
        question = Question(step.name, "Was it bubble 0 that stood up, and no other?", "see", 0, look=True)
        seen = self._person.look(question) if self._person else None
        self._skin.sleep(3.0)
        self._let_go(step)
        if not step.findings and not (self._ask(question) if seen is None else seen):
            step.findings.append(verdicts.wrong_bubble(0))

    def all(self, step: Step) -> None:
        """All bubbles rise."""
        self._go(step, f"All bubbles now rise to {self._low:g} mm, for two seconds. Shall they?")
        self._show(step, range(self._skin.info.bubbles))
        self._skin.sleep(2.0)
        self._faults(step)
        self._let_go(step)

    @property
    def _low(self) -> float:
        return self._board.height_mm(LOW_SHARE)

    def _show(self, step: Step, bubbles: "list[int] | range") -> None:
        try:
            state = self._skin.show(self._board.heights(bubbles, self._low), plan=False)
            step.figures["height_mm"] = np.round(state.height_mm, 3).tolist()
            step.figures["pressure_kpa"] = np.round(state.pressure_kpa, 3).tolist()
        except LinkError:
            raise
        except BubbleskinError as error:
            if not self._faults(step):  # which say it better
                step.findings.append(verdicts.not_settled(str(error)))

    def _faults(self, step: Step) -> bool:
        known = {(finding.name, finding.parts) for finding in step.findings}
        found = verdicts.of_faults(self._skin.health().board_faults, "the board")
        for bubble, names in self._skin.faults().items():
            found += verdicts.of_faults(names, f"bubble {bubble}")
        step.findings += [finding for finding in found if (finding.name, finding.parts) not in known]
        return bool(found)

    def _let_go(self, step: Step) -> None:
        self._skin.vent()
        self._skin.sleep(2.0)
        left = self._skin.state().pressure_kpa - self._board.zero_kpa
        step.findings += verdicts.not_flat(left.tolist())

    def trim(self, step: Step) -> None:
        """The zeros are used, and kept."""
        kept = "and kept without power" if self._save else "until the board restarts"
        self._go(step, f"The sensors' zeros as they were found are now used, {kept}. Shall they be?")
        trim = zeroed(self._skin.trim(), 1e3 * self._board.zero_kpa, self._data.SENSOR_PA_PER_COUNT)
        self._skin.upload_trim(trim)
        if self._save:
            self._skin.save()
        self.found.trim, self.found.saved = trim, self._save
        step.figures = {"zero": trim.zero.tolist(), "said": f"{min(trim.zero)} to {max(trim.zero)} counts"}


def zeroed(trim: Trim, off_pa: np.ndarray, pa_per_count: float) -> Trim:
    """The trim whose zeros make up for what sensors said without pressure, Pa, (n,)."""
    return replace(trim, zero=trim.zero + np.rint(off_pa / pa_per_count).astype(trim.zero.dtype))
