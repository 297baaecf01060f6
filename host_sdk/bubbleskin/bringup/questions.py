"""What whoever sits before the board is asked to do, or to look at."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """One question. Unless it is a `look`, only yes goes on: no ends the bring-up, with everything vented."""

    step: str
    """The step that it belongs to."""
    text: str
    """What to do or to look at, and what comes after the yes."""
    act: str = ""
    """What is to be done, in a word, for whoever is no person: press, release, pull, all_on, pump_off or pump_on; or to be looked
    at: listen or see. Empty where there is nothing to do."""
    bubble: int | None = None
    """The bubble that it is about."""
    look: bool = False
    """Whether it asks what was seen or heard: yes and no are both answers."""


Ask = Callable[[Question], bool]
"""Asks a question and returns whether the answer is yes; a `KeyboardInterrupt` ends the bring-up as no does."""
