"""What a sweep goes through: one task on simulated wristbands that differ in what varies."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple, Self
from urllib.parse import quote, urlencode

from bubbleskin import boards, checks
from bubbleskin.errors import InvalidInput
from bubbleskin.files import parse_toml, read_text
from bubbleskin.sim.options import Options
from bubbleskin.sim.recipe import make_parameters

Value = str | int | float | bool
SEEDS_MAX = 100_000
POINTS_MAX = 1_000_000
SCHEMES = ("sim", "micropython")
_KEYS = ("name", "task", "board", "target", "seeds", "plant", "options")


class Point(NamedTuple):
    """One wristband of a study."""

    number: int
    url: str
    varied: dict[str, Value]
    """What sets it apart: the plant's options that vary, and its seed."""


@dataclass(frozen=True)
class Study:
    """One task on `seeds` wristbands of each combination of what `plant` varies.

    `task`: a name of `bubbleskin.sweeps.tasks.TASKS`, or 'module:function' of your own: `function(skin, random, **options)`
    returns numbers by their names. `plant`: options of simulated boards, each one value or several. `target`: the scheme,
    sim or micropython.
    """

    task: str
    board: str = boards.DEFAULT
    target: str = "sim"
    seeds: int = 1
    plant: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)
    options: Mapping[str, Value] = field(default_factory=dict)
    name: str = "sweep"

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """From a .toml file; `InvalidInput` says what is wrong in it."""
        return cls.of(parse_toml(read_text(path, "the study"), f"The study {path}"), f"The study {path}")

    @classmethod
    def of(cls, said: Mapping[str, Any], where: str = "The study") -> Self:
        """From what a file says: `task`, and where it differs `board`, `target`, `seeds`, `name`, `[plant]`, `[options]`."""
        of = f"{where[0].lower()}{where[1:]}"  # within a sentence
        for key in said:
            if key not in _KEYS:
                raise InvalidInput(f"{where} has {checks.shown(key)}; known are {', '.join(_KEYS)}.")
        if "task" not in said:
            raise InvalidInput(
                f'{where} names no task; write task = "reach", or a function of yours as "module:function".'
            )
        plant = {}
        for name, value in _mapping(where, "plant", said).items():
            several = value if isinstance(value, list | tuple) else [value]
            if not several:
                raise InvalidInput(f"{where} has no value for {name} in [plant]; give one or several.")
            plant[name] = tuple(_value(f"{name} in [plant] of {of}", each) for each in several)
        if "seed" in plant:
            raise InvalidInput(f"{where} has seed in [plant]; say how many there are instead: seeds = 50.")
        study = cls(
            task=checks.text(f"The task of {of}", said["task"]),
            board=checks.text(f"The board of {of}", said.get("board", boards.DEFAULT)),
            target=said.get("target", "sim"),
            seeds=checks.whole(f"The seeds of {of}", said.get("seeds", 1), 1, SEEDS_MAX),
            plant=plant,
            options={
                name: _value(f"{name} in [options] of {of}", value)
                for name, value in _mapping(where, "options", said).items()
            },
            name=checks.text(f"The name of {of}", said.get("name", "sweep")),
        )
        checks.one_of(f"The target of {of}", study.target, SCHEMES)
        boards.load(study.board)
        for name, values in plant.items():
            for value in values:
                _check_option(study.target, name, value, f"[plant] of {of}")
        combinations = 1
        for values in plant.values():
            combinations *= len(values)
        if combinations * study.seeds > POINTS_MAX:
            raise InvalidInput(f"{where} is of {combinations * study.seeds} wristbands; {POINTS_MAX} at most.")
        return study

    def points(self) -> list[Point]:
        """All its wristbands, combination by combination."""
        names = list(self.plant)
        found: list[Point] = []
        for values in product(*self.plant.values()):
            for seed in range(self.seeds):
                options = dict(zip(names, values, strict=True)) | {"seed": seed}
                said = {name: _in_a_url(value) for name, value in options.items()}
                url = f"{self.target}://{quote(self.board)}?{urlencode(said)}"
                varied = {name: value for name, value in options.items() if name == "seed" or len(self.plant[name]) > 1}
                found.append(Point(len(found), url, varied))
        return found

    @property
    def digest(self) -> str:
        """Says whether rows that were kept are of this study."""
        said = [self.task, self.board, self.target, self.seeds, dict(self.plant), dict(self.options)]
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:16]


def _in_a_url(value: Value) -> Value:
    return int(value) if isinstance(value, bool) else value


def _check_option(target: str, name: str, value: Value, where: str) -> None:
    """`InvalidInput` where no wristband can have this, before the first of thousands is made."""
    asked = Options.parse({name: str(_in_a_url(value))}, f"{target}:// in {where}")
    if name != "plant":  # a file that the workers have
        make_parameters(1, 0, asked.spread, **asked.plant)


def _mapping(where: str, name: str, said: Mapping[str, Any]) -> Mapping[str, Any]:
    found = said.get(name, {})
    if not isinstance(found, Mapping):
        raise InvalidInput(f"{where} has {name} = {checks.shown(found)}; it is a section, [{name}].")
    return found


def _value(what: str, value: Any) -> Value:
    if isinstance(value, str | bool | int):
        return value
    return checks.number(what, value)
