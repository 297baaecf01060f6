"""`flash` from finding a board to its answer, by UF2, on a computer whose wristband runs the firmware in this process."""

import errno
import shutil

import pytest

from bubbleskin.errors import BubbleskinError, InvalidInput, LinkError
from bubbleskin.flash import Order, flash
from bubbleskin.flash.history import History
from bubbleskin.flash.machine import among, fat_mounts

PORT = "/dev/ttyBubble"
BLOCKS = 61


@pytest.fixture
def bring(computer, file, tmp_path, images):
    """`bring(**order)`: flash, with today's firmware being images.new."""
    new = file(images.new, "today.uf2")

    def bring(report=lambda *_: None, **order):
        return flash(computer, Order(**order), report, build=lambda board: new, history=tmp_path / "history")

    return bring


def test_from_the_boot_loader_to_the_answer(computer, bring, images):
    computer.plug_in(bootsel=True)
    steps = []
    outcome = bring(lambda *step: steps.append(step), board="wristband7")
    assert (outcome.how, outcome.info.board, outcome.old) == ("uf2", "wristband7", None)
    assert computer.flash.startswith(images.new.data)
    copied = [done / total for title, done, total in steps if title == "copying the firmware"]
    assert copied == sorted(copied)
    assert (copied[0], copied[-1]) == (0, 1)


def test_a_running_firmware_is_asked_for_the_boot_loader(computer, bring, file, images):
    computer.plug_in()
    outcome = bring(uf2=file(images.new))
    assert outcome.info.boot_id == 2
    assert outcome.old == outcome.info.firmware
    assert computer.flash.startswith(images.new.data)


EVERYDAY = (1, 2, BLOCKS // 2, BLOCKS - 1)


@pytest.mark.parametrize(
    "cut", [pytest.param(cut, marks=() if cut in EVERYDAY else pytest.mark.slow) for cut in range(1, BLOCKS)]
)
def test_power_lost_after_any_block_is_repaired_by_the_next_flash(computer, bring, cut, images):
    computer.plug_in(bootsel=True)
    computer.cut_after = cut
    with pytest.raises(LinkError, match=r"has gone after|no wristband answers"):  # the last block looks like the end
        bring(board="wristband7")
    computer.plug_in()  # no button
    if cut == 1:
        assert computer.board  # the old firmware, unharmed
        computer.plug_in(bootsel=True)
    assert computer.rom
    outcome = bring()  # this computer remembers which board it was
    assert outcome.info.board == "wristband7"
    computer.plug_in(bootsel=True)
    with pytest.raises(InvalidInput, match="Which wristband is it"):
        bring()
    assert computer.flash.startswith(images.new.data)


def test_a_drive_that_fails_but_keeps_power_is_repaired_by_the_next_flash(computer, bring):
    computer.plug_in(bootsel=True)
    computer.fail_after = (30, errno.EIO)
    with pytest.raises(LinkError, match="flash again"):
        bring(board="wristband7")
    computer.fail_after = None
    assert bring(board="wristband7").info.board == "wristband7"


def test_the_way_back(computer, bring, file, images):
    computer.plug_in(bootsel=True)
    with pytest.raises(InvalidInput, match="No earlier firmware"):
        bring(board="wristband7", previous=True)
    bring(board="wristband7", uf2=file(images.old, "old.uf2"))
    silent = images.big
    del computer.programs[images.big.data]
    with pytest.raises(LinkError, match=r"no wristband answers within 30 s.*BOOTSEL.*--previous"):
        bring(uf2=file(silent, "silent.uf2"))
    computer.plug_in(bootsel=True)
    assert bring(board="wristband7", previous=True).info.board == "wristband7"
    assert computer.flash.startswith(images.old.data)
    bring(uf2=file(images.new))  # which works, and is not wanted all the same
    bring(previous=True)
    assert computer.flash.startswith(images.old.data)


def test_another_boards_firmware_is_noticed_before_by_name_and_after_by_answer(computer, bring, file, images):
    computer.plug_in()
    with pytest.raises(InvalidInput, match="made for wristband19, and this is a wristband7"):
        bring(uf2=file(images.big, "wristband19-12.2.1-0123.uf2"))
    with pytest.raises(InvalidInput, match="is a wristband7, and wristband19 was asked for"):
        bring(board="wristband19")
    assert computer.flash.startswith(images.old.data)
    assert computer.boots == 1
    with pytest.raises(BubbleskinError, match="What answers now is a wristband19, and wristband7 was meant"):
        bring(uf2=file(images.big, "renamed.uf2"))


def test_nothing_is_touched_where_the_file_is_damaged(computer, bring, file, images):
    computer.plug_in()
    path = file(images.new)
    path.write_bytes(path.read_bytes()[:-512])
    with pytest.raises(InvalidInput, match="damaged"):
        bring(uf2=path)
    assert computer.boots == 1
    with pytest.raises(InvalidInput, match=r"Cannot read the firmware .*nowhere\.uf2"):
        bring(uf2=path.with_name("nowhere.uf2"))


def test_nothing_is_found(computer, bring, tmp_path):
    with pytest.raises(LinkError, match=r"No wristband is found\. Plug it in.*BOOTSEL"):
        bring()
    computer.hidden = tmp_path / "by-label"
    with pytest.raises(LinkError, match=r"not mounted.*udisksctl mount -b"):
        bring()


def test_several_are_found(computer, bring, tmp_path):
    computer.plug_in()
    computer.more_ports = ["/dev/ttyOther"]
    computer.more_drives = [tmp_path / "elsewhere"]
    with pytest.raises(InvalidInput, match=r"3 boards are attached, at /dev/ttyBubble, /dev/ttyOther, .*--device"):
        bring()


def test_the_one_that_is_named_is_taken_and_its_drive_told_from_others(computer, bring, file, tmp_path, images):
    computer.plug_in()
    computer.more_ports = ["/dev/ttyOther"]
    computer.more_drives = [tmp_path / "elsewhere"]
    assert bring(device=PORT, uf2=file(images.new)).info.boot_id == 2


def test_the_port_is_busy_or_not_there(computer, bring):
    computer.plug_in()
    with pytest.raises(LinkError, match="There is no /dev/ttyNowhere"):
        bring(device="/dev/ttyNowhere")
    computer.busy = True
    with pytest.raises(LinkError, match="in use by another program"):
        bring()


@pytest.mark.parametrize(
    ("info", "words"),
    [
        ("UF2 Bootloader v1.0\nModel: Raspberry Pi RP2350\nBoard-ID: RP2350\n", "wrong kind: it says RP2350"),
        ("UF2 Bootloader\n", "wrong kind: it says nothing"),
    ],
)
def test_a_drive_of_another_chip(computer, bring, info, words, images):
    computer.plug_in(bootsel=True)
    (computer.drive / "INFO_UF2.TXT").write_text(info)
    with pytest.raises(InvalidInput, match=words):
        bring(board="wristband7")
    assert computer.flash.startswith(images.old.data)


def test_a_folder_that_is_no_drive(bring, tmp_path):
    with pytest.raises(InvalidInput, match=r"no boot loader's drive: it has no INFO_UF2\.TXT"):
        bring(drive=tmp_path, board="wristband7")


@pytest.mark.parametrize(
    ("fail_after", "words"),
    [
        ((0, errno.EROFS), "cannot be written to"),
        ((0, errno.EACCES), "cannot be written to"),
        ((9, errno.ENOSPC), "is full after"),
        ((9, errno.EIO), "has gone after"),
    ],
)
def test_what_a_drive_may_say(computer, bring, fail_after, words):
    computer.plug_in(bootsel=True)
    computer.fail_after = fail_after
    with pytest.raises(BubbleskinError, match=words):
        bring(board="wristband7")


def test_a_drive_without_space(computer, bring, images):
    computer.plug_in(bootsel=True)
    computer.space = 20000
    with pytest.raises(BubbleskinError, match="19 KiB free, and the firmware needs 31"):
        bring(board="wristband7")
    assert computer.flash.startswith(images.old.data)


def test_a_drive_that_nobody_mounts(computer, bring, file, tmp_path, images):
    computer.plug_in()
    computer.mounts = False
    with pytest.raises(LinkError, match=r"no drive has appeared within 20 s.*the old firmware is still there"):
        bring(uf2=file(images.new))


def test_contradictions_and_what_nobody_can_know(computer, bring, file):
    computer.plug_in(bootsel=True)
    with pytest.raises(InvalidInput, match=r"Which wristband is it.*--board wristband7"):
        bring()
    with pytest.raises(InvalidInput, match="one of --uf2, --mpy and --previous"):
        bring(mpy=True, previous=True)
    with pytest.raises(InvalidInput, match="not both"):
        bring(device=PORT, drive=computer.drive)
    with pytest.raises(InvalidInput, match="leave --mpy off"):
        bring(mpy=True, board="wristband7")


def test_the_history_gives_the_newest_that_worked_but_is_not_what_was_tried_last(tmp_path):
    history = History("wristband7", tmp_path)
    assert history.previous() is None
    history.tried(b"1")
    assert history.previous() is None
    history.remember(b"1")
    assert history.previous() is None  # there is nothing before it
    history.tried(b"2")
    assert history.previous().read_bytes() == b"1"
    history.remember(b"2")
    history.remember(b"2")
    assert history.previous().read_bytes() == b"1"
    history.tried(b"3")
    assert history.previous().read_bytes() == b"2"
    history.remember(b"3")
    assert history.previous().read_bytes() == b"2"
    assert History("wristband19", tmp_path).previous() is None


def test_drives_are_known_by_their_file(tmp_path):
    drive = tmp_path / "with space"
    drive.mkdir()
    (drive / "INFO_UF2.TXT").touch()
    escaped = str(drive).replace(" ", r"\040")
    table = f"proc /proc proc rw 0 0\n/dev/sda1 /boot vfat rw 0 0\n/dev/sdb1 {escaped} vfat rw 0 0\n"
    assert [str(path) for path in fat_mounts(table)] == ["/boot", str(drive)]
    assert among(fat_mounts(table)) == [drive]
    shutil.rmtree(drive)
    assert among(fat_mounts(table)) == []
