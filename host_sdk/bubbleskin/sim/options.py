"""What may follow the `?` of a simulated board's URL: read and checked before anything is started."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import cast

from bubbleskin import checks
from bubbleskin.errors import InvalidInput
from bubbleskin.sim import failures, wiring
from bubbleskin.sim.recipe import NUMBERS, PlantOptions
from bubbleskin.sim.wiring import Wiring

_REAL = ("spread", "loss", *NUMBERS)
_TEXTS = ("rubber", "sheet", "plant")


@dataclass(frozen=True)
class Options:
    """Options of a simulated board, as of `SimulatedBoard` where nothing else is said."""

    seed: int = 0
    spread: float = 0.0
    realtime: bool = False
    """Whether virtual time keeps pace with the wall clock's."""
    loss: float = 0.0
    """Share of all frames that the line loses, in both directions."""
    contact: bool = True
    history: bool = True
    """Whether it keeps what reaches its firmware, for full recordings."""
    store: Path | None = None
    """The file that keeps its flash."""
    plant: PlantOptions = field(default_factory=PlantOptions)
    """What else the plant is asked to be."""
    fail: tuple[tuple[str, int, str], ...] = ()
    """What fails from the start: part, number, and how, as of `bubbleskin.sim.failures`."""
    wiring: Wiring = field(default_factory=Wiring)
    """What is wired wrongly."""

    @classmethod
    def parse(cls, options: dict[str, str], url: str) -> "Options":
        """From the query of `url`; `InvalidInput` for an option that is not known or not a number."""
        known = [field.name for field in fields(cls) if field.name not in ("plant", "wiring")]
        known += [*_TEXTS, *NUMBERS, *wiring.NAMES]
        for name in options:
            if name not in known:
                raise InvalidInput(f"{url} has the option {name!r}; known are {', '.join(known)}.")
        values = {
            name: _number(name, text, url)
            for name, text in options.items()
            if name not in ("store", "fail", *_TEXTS, *wiring.NAMES)
        }
        plant = {name: options[name] for name in _TEXTS if name in options}
        return cls(
            seed=int(values.get("seed", 0)),
            spread=values.get("spread", 0.0),
            realtime=bool(values.get("realtime", False)),
            loss=values.get("loss", 0.0),
            contact=bool(values.get("contact", True)),
            history=bool(values.get("history", True)),
            store=_file(options["store"], url) if "store" in options else None,
            fail=_failures(options["fail"]) if "fail" in options else (),
            wiring=Wiring.parse({name: options[name] for name in wiring.NAMES if name in options}),
            plant=cast(PlantOptions, plant | {name: values[name] for name in NUMBERS if name in values}),
        )


def _number(name: str, text: str, url: str) -> float:
    shown = f"{name} of {url}"
    number = checks.written(shown, text)
    if name in _REAL:
        return number  # its range is the board's to say
    return checks.whole(shown, number, 0, checks.SEED_MAX if name == "seed" else 1)


def _failures(text: str) -> tuple[tuple[str, int, str], ...]:
    """`sensor3-stuck,pump-off`: the part, the bubble's number where it has one, a dash, and how."""
    found = []
    for said in text.split(","):
        part, _, how = said.rpartition("-")
        word = part.rstrip("0123456789")
        number = part[len(word) :]
        if not word:
            raise InvalidInput(
                f"fail has {said!r}; give part, number and how it fails, such as fail=sensor3-stuck,pump-off."
            )
        failures.failure_of(failures.part_of(word), how)
        if failures.part_of(word) in failures.OF_BUBBLES and not number:
            raise InvalidInput(f"fail has {said!r}; say of which bubble, such as fail={word}3-{how}.")
        found.append((word, int(number or 0), how))
    return tuple(found)


def _file(name: str, url: str) -> Path:
    if not (name and url.startswith("sim:")):
        raise InvalidInput(f"{url} has store={name!r}; only sim:// keeps its store in a file: store=wristband.bin.")
    return Path(name)
