"""Firmware as files on a stock MicroPython: two slots, of which one works while the other one is written.

Every step leaves a board on which the old firmware, the new one or the prompt answers, and from every such board
the same steps lead to the end: what is there and right is not written again. Only files named in `starter` and
folders of slots are touched; all others, the stored calibration among them, are not ours.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

from bubbleskin.errors import BubbleskinError
from bubbleskin.flash import mpy, starter
from bubbleskin.flash.drive import Progress
from bubbleskin.flash.prompt import Prompt

_OLD_MAIN = "/main-before-bubbleskin.py"
_SPARE = 4  # blocks of the file system that are left free, for the pointer and for whatever the user stores
_FOLDER_BLOCKS = 2  # littlefs keeps a folder in two


@dataclass(frozen=True)
class Slots:
    """What the board has: the slot in use, "" where none is, and the one that may be written."""

    now: str
    other: str
    main: str
    """The content of `main.py`."""

    @property
    def ours(self) -> bool:
        """Whether our starter is in charge."""
        return self.main.startswith(starter.MARK)


def look(prompt: Prompt) -> Slots:
    """The board's slots."""
    now = prompt.text(starter.POINTER)[:1]
    now = now if now in starter.SLOTS else ""
    return Slots(now, "b" if now == "a" else "a", prompt.text(starter.MAIN))


def update(
    prompt: Prompt,
    slots: Slots,
    files: dict[str, bytes],
    report: Progress,
    try_it: Callable[[Prompt, str], Prompt],
) -> Prompt:
    """Bring `files` onto the board and into use; returns the prompt to go on with.

    `try_it` restarts the board, sees the firmware in the slot it is given answer, ends it, and returns its prompt.
    Where it raises, the board has its old firmware in use.
    """
    slot = write(prompt, slots, files, report)
    install_starter(prompt, slots)
    if slot != slots.now:
        try_next(prompt, slot)
        prompt = try_it(prompt, slot)
    use(prompt, slot)
    return prompt


def write(prompt: Prompt, slots: Slots, files: dict[str, bytes], report: Progress) -> str:
    """Bring `files` into a slot that is not in use and verify each; returns the slot.

    It is the slot in use, untouched, if that has these very files already.
    """
    wanted = {name: (len(data), _sha(data)) for name, data in files.items()}
    if slots.now and slots.ours and _below(prompt, slots.now) == wanted:
        return slots.now
    slot = slots.other
    folder = starter.FOLDER + slot
    found = prompt.tree(folder)
    stale = [name for name, entry in found.items() if entry and wanted.get(name[len(folder) + 1 :]) != entry]
    start = f"{folder}/{mpy.LAST}"
    missing = [name for name in files if found.get(f"{folder}/{name}") != wanted[name]]
    if missing and mpy.LAST not in missing:
        missing.append(mpy.LAST)
    if missing and start in found:  # first of all: a slot with `LAST` counts as whole
        stale = [start, *(name for name in stale if name != start)]
    for name in stale:
        prompt.remove(name)
    folders = [folder, *dict.fromkeys(f"{folder}/{path}" for name in files for path in _folders(name))]
    _check_space(prompt, [files[name] for name in missing], sum(path not in found for path in folders))
    for path in folders:
        if path not in found and not (path == folder and _is_folder(prompt, path)):
            prompt.run(f"import os; os.mkdir({path!r})")
    total = sum(len(files[name]) for name in missing)
    done = 0
    for name in (name for name in missing if name != mpy.LAST):
        report("installing the firmware", done, total)
        prompt.write(f"{folder}/{name}", files[name])
        done += len(files[name])
    report("installing the firmware", done, total)
    if missing:
        _verify(_below(prompt, slot), {name: entry for name, entry in wanted.items() if name != mpy.LAST})
        prompt.put(start, files[mpy.LAST])
        _verify({mpy.LAST: prompt.sum(start)}, {mpy.LAST: wanted[mpy.LAST]})
    report("installing the firmware", total, total)
    return slot


def install_starter(prompt: Prompt, slots: Slots) -> None:
    """Put our `main.py` in charge; a user's own is kept under another name."""
    if slots.main == starter.TEXT:
        return
    prompt.write(starter.MAIN + ".new", starter.TEXT.encode())
    if slots.main and not slots.ours:
        prompt.rename(starter.MAIN, _OLD_MAIN)
    prompt.rename(starter.MAIN + ".new", starter.MAIN)


def try_next(prompt: Prompt, slot: str) -> None:
    """Let the next start, and no other, be that of `slot`."""
    prompt.put(starter.TRIAL, slot.encode())


def use(prompt: Prompt, slot: str) -> None:
    """Let every start from now on be that of `slot`, then remove the other one."""
    prompt.put(starter.POINTER, slot.encode())
    prompt.remove(starter.TRIAL)
    folder = starter.FOLDER + ("b" if slot == "a" else "a")
    found = prompt.tree(folder)
    start = f"{folder}/{mpy.LAST}"
    names = [name for name, entry in found.items() if entry and name != start]
    for name in [start, *names] if start in found else names:
        prompt.remove(name)
    for name in sorted((name for name, entry in found.items() if not entry), reverse=True):
        prompt.remove(name, folder=True)
    if _is_folder(prompt, folder):
        prompt.remove(folder, folder=True)


def running(prompt: Prompt) -> tuple[str, str]:
    """At the prompt that a firmware has left to us: which slot it was started from, and what kept another from starting."""
    slot, problem = prompt.value("(globals().get('slot', ''), globals().get('problem', ''))")
    return str(slot), str(problem)


def _below(prompt: Prompt, slot: str) -> dict[str, tuple[int, bytes]]:
    folder = starter.FOLDER + slot
    return {name[len(folder) + 1 :]: entry for name, entry in prompt.tree(folder).items() if entry}


def _verify(there: dict[str, tuple[int, bytes]], wanted: dict[str, tuple[int, bytes]]) -> None:
    wrong = sorted(name for name in wanted.keys() | there.keys() if wanted.get(name) != there.get(name))
    if wrong:
        raise BubbleskinError(
            f"{wrong[0]} and {len(wrong) - 1} other files are not on the board as they were sent. The firmware that was "
            "there is still in use. Flash again; if this stays so, the board's flash is worn out."
        )


def _check_space(prompt: Prompt, contents: list[bytes], folders: int) -> None:
    block, free = prompt.value("(lambda s: (s[0], s[3]))(__import__('os').statvfs('/'))")
    need = sum(-(-len(data) // block) for data in contents) + _FOLDER_BLOCKS * folders + _SPARE
    if free < need:
        raise BubbleskinError(
            f"The board has {free * block // 1024} KiB free, and the firmware needs {need * block // 1024}. Remove files "
            "of your own from it (`mpremote fs ls`, `mpremote fs rm`), then flash again; nothing has been changed."
        )


def _is_folder(prompt: Prompt, path: str) -> bool:
    return bool(prompt.value(f"{path[1:]!r} in __import__('os').listdir('/')"))


def _folders(name: str) -> list[str]:
    parts = name.split("/")[:-1]
    return ["/".join(parts[: depth + 1]) for depth in range(len(parts))]


def _sha(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()
