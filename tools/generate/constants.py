"""Write the constants that device files repeat into their marked regions, from where they are defined.

python tools/generate/constants.py            # write them
python tools/generate/constants.py --check    # fail if a region is not what would be written

MicroPython folds constants of the same module only: what another module defines is a dictionary look-up there, and in
viper a call. A device file says what it wants above a region, and the region holds it under a leading underscore, which
costs no memory on the device:

    # [constants] bubble_protocol.schema.faults: LEAK NO_AIR OVERFILLED as BOARD_OVERFILLED
    # [constants] message INFO_REPLY as INFO: *
    _LEAK = const(8)
    ...
    # [end of constants]

`module: NAMES`, or `*` for all whole numbers of the module whose names are capital letters, or `used` for those of them
that the file uses outside its regions, under a leading underscore. `message NAME as PREFIX`
gives the places of the message's fields in the values of a handler: `_INFO_LATE_TICKS`; of a repeated field the place
in the first repetition, and `_INFO_STRIDE` values from one repetition to the next. Fields are chosen in the same ways.
"""

import re
from importlib import import_module
from pathlib import Path

import generated

from bubble_protocol import codec
from bubble_protocol.schema import messages

FOLDERS = ("protocol/bubble_protocol", "firmware/bubble_firmware")
REGION = re.compile(
    r"(?P<head>(?:^# \[constants\] [^\n]*\n)+)(?P<body>.*?)^# \[end of constants\]\n", re.MULTILINE | re.DOTALL
)


def places(name: str) -> dict[str, int]:
    """Where each field of a message stands in a handler's values, and STRIDE where fields repeat."""
    message = codec.BY_NAME[name]
    found, at = {}, 0
    for field in message.fixed:
        found[field[0].upper()] = at
        at += codec.TEXT_SIZE if field[1] == messages.TEXT else 1
    for offset, field in enumerate(message.repeated):
        found[field[0].upper()] = at + offset
    if message.repeated:
        found["STRIDE"] = len(message.repeated)
    return found


def wanted(line: str, words: set[str]) -> dict[str, int]:
    """The constants that one `# [constants]` line asks for, by their names in the device's file, whose `words` are these."""
    source, _, names = line.removeprefix("# [constants] ").partition(":")
    prefix = ""
    if source.startswith("message "):
        message, _, prefix = source.removeprefix("message ").partition(" as ")
        known = places(message)
        prefix = f"{prefix or message}_"
    else:
        values = vars(import_module(source))
        known = {name: value for name, value in values.items() if name.isupper() and type(value) is int}
    if names.strip() in ("*", "used"):
        ours = {f"_{prefix}{name}": value for name, value in known.items() if not name.startswith("_")}
        return ours if names.strip() == "*" else {name: value for name, value in ours.items() if name in words}
    found = {}
    for name, _, alias in re.findall(r"(\w+)( as (\w+))?", names):
        if name.upper() not in known:
            raise SystemExit(f"{line.strip()}: there is no {name}. There are: {', '.join(known)}.")
        found[f"_{alias or prefix + name.upper()}"] = known[name.upper()]
    return found


def filled(text: str) -> str:
    """The text of a device file with all its regions as they should be."""
    words = set(re.findall(r"\w+", REGION.sub("", text)))

    def region(match: re.Match[str]) -> str:
        lines = match["head"].splitlines()
        constants: dict[str, int] = {}
        for line in lines:
            constants.update(wanted(line, words))
        body = "".join(f"{name} = const({value})\n" for name, value in constants.items())
        return match["head"] + body + "# [end of constants]\n"

    return REGION.sub(region, text)


def files() -> dict[Path, object]:
    """Every device file with a region, and what makes it."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((generated.ROOT / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if "# [constants]" in text:
                found[path.relative_to(generated.ROOT)] = lambda text=text: filled(text)
    return found


if __name__ == "__main__":
    generated.main(files())
