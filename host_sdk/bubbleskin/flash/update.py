"""`flash`: find the board, bring the firmware onto it, see it answer; say in plain words what to do where that fails."""

import contextlib
from collections.abc import Callable
from pathlib import Path

from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.device.info import Info
from bubbleskin.errors import BubbleskinError, InvalidInput, LinkError, WrongDevice
from bubbleskin.flash import mpy, slots, uf2
from bubbleskin.flash.drive import Progress, check_drive, copy_image
from bubbleskin.flash.history import History, UnderWay
from bubbleskin.flash.machine import Connection, Machine
from bubbleskin.flash.order import Order, Outcome
from bubbleskin.flash.prompt import Prompt
from bubbleskin.link.link import run_sync
from bubbleskin.skin import Skin
from bubbleskin.toolchain.rp2040 import firmware

_HELLO_S = 1.5  # for one attempt
_DRIVE_S = 20.0  # until the boot loader's drive is there and mounted
_BACK_S = 30.0  # until new firmware answers
_STEP_S = 0.25

BOOTSEL = "unplug the wristband, hold BOOTSEL while you plug it in, then run `bubbleskin flash` again"


def flash(
    machine: Machine,
    order: Order,
    report: Progress = lambda title, done, total: None,
    *,
    build: Callable[[str], Path] = lambda board: firmware([board])[board],
    files: Callable[[str], dict[str, bytes]] = mpy.files,
    history: Path | None = None,
) -> Outcome:
    """Do what `order` says to the one board that is meant.

    `build` gives the UF2 of a board, `files` its .mpy files, `history` is the folder of UF2s known to work. Raises
    `InvalidInput` where it is not clear what is meant, other `BubbleskinError`s where it could not be done; their
    sentences say how the board is left and what to do.
    """
    if sum((order.uf2 is not None, order.mpy, order.previous)) > 1:
        raise InvalidInput("Say one of --uf2, --mpy and --previous, or none: then today's firmware is taken.")
    if order.device and order.drive:
        raise InvalidInput("Say --device for a board that runs, or --drive for one in its boot loader, not both.")
    return _Update(machine, order, report, build, files, history).run()


class _Update:
    def __init__(
        self,
        machine: Machine,
        order: Order,
        report: Progress,
        build: Callable[[str], Path],
        files: Callable[[str], dict[str, bytes]],
        history: Path | None,
    ):
        self.machine = machine
        self.order = order
        self.report = report
        self.build = build
        self.files = files
        self.history = history
        self.under_way = UnderWay(history)
        self.others: set[str] = set()  # ports of boards that are not meant
        self.unlisted = False  # whether the port is a socket, a link or anything else that `ports` does not tell of
        self.port = ""
        self.old: Info | None = None
        self.complaint = ""  # of the last HELLO

    def run(self) -> Outcome:
        drive = self.find()
        if drive is not None:
            if self.order.mpy:
                raise InvalidInput("The board is in its boot loader, which takes a UF2 only: leave --mpy off.")
            return self.by_uf2(drive)
        self.report("asking the board", 0, 1)
        self.old = self.greet(_HELLO_S)
        if self.old:
            self.check_board(self.old)
            if self.order.uf2 or self.order.previous:
                self.image()  # before anything is changed
                return self.by_uf2(self.into_boot_loader())
            self.source()  # before anything is changed
            self.restart("prompt")
        return self.at_prompt()

    # ---- which board

    def find(self) -> Path | None:
        """The drive of the one board that is meant, or None with its port in `port`."""
        order, machine = self.order, self.machine
        ports, found = machine.ports(), machine.drives()
        if order.drive:
            self.others = set(ports)
            return order.drive
        if order.device:
            self.port = order.device
            self.others = set(ports) - {order.device}
            self.unlisted = order.device not in ports
            return None
        if len(ports) + len(found) > 1:
            names = ", ".join([*ports, *map(str, found)])
            raise InvalidInput(
                f"{len(ports) + len(found)} boards are attached, at {names}: say which one is meant with --device PORT or "
                "--drive DIR."
            )
        if found:
            return found[0]
        if ports:
            self.port = ports[0]
            return None
        raise LinkError(self.not_found())

    def not_found(self) -> str:
        hidden = self.machine.unmounted()
        if hidden:
            return (
                f"A boot loader's drive is there, at {hidden}, but not mounted. Open it in the file manager, or run "
                f"`udisksctl mount -b {hidden}`, then flash again."
            )
        return (
            "No wristband is found. Plug it in with a cable that carries data. If it stays unfound, hold BOOTSEL while "
            "you plug it in: a drive called RPI-RP2 appears. Then flash again."
        )

    def check_board(self, info: Info) -> None:
        asked = _name_of(self.order.board) if self.order.board else info.board
        if asked != info.board:
            raise InvalidInput(
                f"The board at {self.port} is a {info.board}, and {asked} was asked for. Leave --board off, or "
                f"hold BOOTSEL while you plug it in if it shall become a {asked}."
            )

    def board(self) -> str:
        """The board's name, which neither a boot loader nor a stock MicroPython knows."""
        return self.old.board if self.old else _name_of(self.source())

    def source(self) -> str:
        """What its firmware is made for: a board's name, or the path of its file."""
        if self.order.board:
            return self.order.board
        if self.old:
            if self.old.board not in boards.NAMES:
                raise InvalidInput(
                    f"The board at {self.port} is a {self.old.board}, which is none of {', '.join(boards.NAMES)}: "
                    f"say where its file is, such as --board path/to/{self.old.board}.py."
                )
            return self.old.board
        begun = self.under_way.board()
        if begun:
            return begun
        raise InvalidInput(
            "Which wristband is it? Nothing of ours is on it yet to say so: add --board "
            f"{' or --board '.join(boards.NAMES)}, or --board FILE.py for one of your own."
        )

    # ---- talking to it

    def greet(self, timeout: float) -> Info | None:
        """HELLO once: who answers, None where nobody does or does not speak our protocol."""
        connection = self.machine.open(self.port)
        try:
            with Skin(run_sync(AsyncSkin.open(connection, timeout))) as skin:
                return skin.info
        except WrongDevice as problem:
            self.complaint = str(problem)
            return None

    def restart(self, into: str) -> None:
        with Skin(run_sync(AsyncSkin.open(self.machine.open(self.port), _HELLO_S))) as skin:
            skin.restart(into)
        self.machine.sleep(_STEP_S)

    def into_boot_loader(self, prompt: Prompt | None = None) -> Path:
        """Let the board go into its boot loader; its drive."""
        before = set(self.machine.drives())
        self.under_way.begin(self.order.board or (self.old.board if self.old else self.source()))
        if prompt:
            with contextlib.suppress(LinkError):  # it may be gone before it has acknowledged
                prompt.leave("import machine; machine.bootloader()")
        else:
            self.restart("boot_loader")
        until = self.machine.now() + _DRIVE_S
        while self.machine.now() < until:
            self.report("waiting for the boot loader's drive", 0, 1)
            found = [drive for drive in self.machine.drives() if drive not in before]
            if len(found) == 1:
                return found[0]
            self.machine.sleep(_STEP_S)
        hidden = self.machine.unmounted()
        raise LinkError(
            self.not_found()
            if hidden
            else f"The board went into its boot loader, but no drive has appeared within {_DRIVE_S:g} s. Where drives are "
            "not mounted by themselves, mount it and add --drive DIR; the old firmware is still there and runs again "
            "after the cable has been pulled and plugged in."
        )

    # ---- by UF2

    def image(self) -> uf2.Image:
        """What is to be copied."""
        order = self.order
        if order.uf2:
            named = [board for board in boards.NAMES if order.uf2.name.split("-")[0].split(".")[0] == board]
            if named and named[0] != self.board():
                raise InvalidInput(
                    f"{order.uf2} is made for {named[0]}, and this is a {self.board()}. Take the file for {self.board()}."
                )
            return uf2.read(order.uf2)
        if order.previous:
            path = History(self.board(), self.history).previous()
            if path is None:
                raise InvalidInput(
                    f"No earlier firmware of a {self.board()} is on this computer. Give a file: --uf2 FILE."
                )
            return uf2.read(path)
        return uf2.read(self.build(self.source()))

    def by_uf2(self, drive: Path) -> Outcome:
        check_drive(drive)
        image = self.image()
        board = self.board()
        history = History(board, self.history)
        known = b"".join(
            uf2.block(n, len(image.pages), uf2.FLASH_AT + uf2.PAGE * n, p) for n, p in enumerate(image.pages)
        )
        history.tried(known)
        self.under_way.begin(self.order.board or (self.old.board if self.old else self.source()))
        copy_image(self.machine, drive, image, self.report)
        back = (
            "; `bubbleskin flash --previous` then brings the last firmware back that worked"
            if history.previous()
            else ""
        )
        remedy = f"To try again, {BOOTSEL}{back}."
        info = self.wait_for_hello(
            f"The firmware has been copied, but no wristband answers within {_BACK_S:g} s. {remedy}"
        )
        self.check_answer(info, board, remedy)
        history.remember(known)
        self.under_way.end()
        return Outcome("uf2", info, self.old.firmware if self.old else None)

    def check_answer(self, info: Info, board: str, remedy: str) -> None:
        if info.board != board:
            raise BubbleskinError(f"What answers now is a {info.board}, and {board} was meant. {remedy}")
        if self.old and info.boot_id == self.old.boot_id:
            raise BubbleskinError(f"The wristband has not been started again: the old firmware still runs. {remedy}")
        if not self.order.uf2 and not self.order.previous and not info.same_schema:
            raise BubbleskinError(
                f"What answers is firmware {info.firmware}, and not the one that was copied. {remedy}"
            )

    def wait_for_hello(self, sentence: str) -> Info:
        """The new firmware's answer; `LinkError` with `sentence` where there is none."""
        machine = self.machine
        until = machine.now() + _BACK_S
        while machine.now() < until:
            self.report("waiting for the firmware's answer", 0, 1)
            machine.sleep(_STEP_S)
            if not self.unlisted:  # it may come back under another name
                new = [port for port in machine.ports() if port not in self.others]
                if not new:
                    continue
                self.port = self.port if self.port in new else new[0]
            with contextlib.suppress(LinkError):
                info = self.greet(_HELLO_S)
                if info:
                    return info
        raise LinkError(sentence)

    # ---- by .mpy files, at the prompt

    def at_prompt(self) -> Outcome:
        """The prompt is there, or should be: a stock MicroPython, or our firmware has been ended."""
        connection = self.machine.open(self.port)
        try:
            prompt = self.enter(connection)
            there = slots.look(prompt)
            # A UF2 of ours starts by itself and takes no notice of files, which may be there from before.
            as_files = bool(slots.running(prompt)[0]) if self.old else there.ours
            if not self.order.mpy and not as_files and (self.old or self.order.uf2 or self.order.previous):
                self.image()
                return self.by_uf2(self.into_boot_loader(prompt))
            if self.order.uf2 or self.order.previous:
                raise InvalidInput(
                    "The board runs a stock MicroPython with our files, and a UF2 would take its place: if that is meant, "
                    f"{BOOTSEL}. Its files stay."
                )
            if self.old and not as_files:
                raise InvalidInput(
                    "The firmware is part of this board's UF2, and files would not be used: leave --mpy off."
                )
            return self.by_files(prompt, there)
        finally:
            connection.close()

    def enter(self, connection: Connection) -> Prompt:
        try:
            prompt = Prompt(connection)
        except LinkError:
            if self.old:
                raise LinkError(
                    f"The wristband at {self.port} has not given its prompt. It runs on as before after it has been "
                    f"unplugged and plugged in; if that does not help, {BOOTSEL}."
                ) from None
            if "protocol" in self.complaint:  # too old or too new to be asked to end
                raise WrongDevice(f"{self.complaint} To do so, {BOOTSEL}.") from None
            raise WrongDevice(
                f"What is at {self.port} is of the wrong kind, or it hangs: it answers neither as a wristband nor as "
                f"MicroPython. If it is a wristband, {BOOTSEL}."
            ) from None
        name, number = prompt.value("(lambda s: (s._machine, s._mpy))(__import__('sys').implementation)")
        if not mpy.suits(number):
            raise WrongDevice(
                f"The board at {self.port} is of the wrong kind: {name}, and the wristband has an RP2040 with MicroPython "
                "1.23 or newer. Nothing has been written. Name the right port with --device, or update its MicroPython."
            )
        return prompt

    def by_files(self, prompt: Prompt, there: slots.Slots) -> Outcome:
        board = self.board()
        self.under_way.begin(self.order.board or (self.old.board if self.old else self.source()))
        prompt = slots.update(prompt, there, self.files(self.source()), self.report, self.try_it)
        self.reset(prompt)
        info = self.wait_for_hello(
            f"The new firmware had answered, and does not after the last restart, within {_BACK_S:g} s. Unplug the "
            "wristband, plug it in, then flash again."
        )
        self.check_answer(info, board, "Flash again.")
        self.under_way.end()
        return Outcome("mpy", info, self.old.firmware if self.old else None)

    def reset(self, prompt: Prompt) -> None:
        with contextlib.suppress(LinkError):
            prompt.leave("import machine; machine.reset()")
        prompt.serial.close()

    def try_it(self, prompt: Prompt, slot: str) -> Prompt:
        """Restart, see the firmware in `slot` answer, and make it end; its prompt."""
        self.reset(prompt)
        board = self.board()
        unchanged = "The board keeps what it had: nothing but the new files has changed."
        try:
            info = self.wait_for_hello(f"The new firmware does not answer within {_BACK_S:g} s. {unchanged}")
        except LinkError as silence:
            raise LinkError(f"{silence} {self.why()}") from None
        try:
            self.check_answer(info, board, unchanged)
        except BubbleskinError:
            self.restart("firmware")  # which is the old one again: the trial is over
            raise
        self.restart("prompt")
        prompt = Prompt(self.machine.open(self.port))
        started, problem = slots.running(prompt)
        if started != slot:
            self.reset(prompt)
            raise BubbleskinError(f"The new firmware has not started ({problem}), and the old one runs. {unchanged}")
        return prompt

    def why(self) -> str:
        """What the starter says at a prompt of which no firmware has taken hold."""
        with contextlib.suppress(BubbleskinError):
            prompt = Prompt(self.machine.open(self.port))
            problem = slots.running(prompt)[1]
            prompt.serial.close()
            if problem:
                return f"MicroPython says: {problem}."
        return "Unplug it, plug it in, then flash again."


def _name_of(board: str) -> str:
    """The name of a board, given by its name or by the path of its file."""
    name: str = boards.load(board).NAME if boards.is_file(board) else board
    return name
