"""UF2 files: what is refused, and that the order of the blocks makes every interruption end in the boot loader."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bubbleskin.errors import InvalidInput
from bubbleskin.flash import uf2
from bubbleskin.sim.rp2040 import boot_rom


def image(seed: int, pages: int) -> uf2.Image:
    """Pages of noise, the first with the checksum that the ROM wants."""
    noise = [bytes((seed + 31 * page + 7 * at) & 0xFF for at in range(uf2.PAGE)) for page in range(pages)]
    first = noise[0][:-4]
    return uf2.Image((first + struct.pack("<I", crc(first)), *noise[1:]))


def crc(data: bytes) -> int:
    """Long division by the polynomial, bit by bit, of the message with 32 ones on top: no table, no library."""
    number = (int.from_bytes(data, "big") ^ (0xFFFFFFFF << 8 * len(data) - 32)) << 32
    for bit in range(8 * len(data) + 31, 31, -1):
        if number >> bit & 1:
            number ^= 0x104C11DB7 << bit - 32
    return number


def ordinary(image: uf2.Image) -> bytes:
    """As `uf2conv.py` writes it."""
    n = len(image.pages)
    return b"".join(uf2.block(i, n, uf2.FLASH_AT + uf2.PAGE * i, page) for i, page in enumerate(image.pages))


GOOD = image(1, 40)
FILES = bytes(range(256)) * 16  # a sector of the file system


def flash_with(image: uf2.Image) -> bytearray:
    flash = bytearray(image.data).ljust(2 << 20, b"\xff")
    at = uf2.FILES_AT - uf2.FLASH_AT
    flash[at : at + len(FILES)] = FILES
    return flash


def copy(flash: bytearray, image: uf2.Image, blocks: int | None = None) -> bool:
    """Write so many blocks of `image` through the boot ROM; whether it has restarted the chip, with the very last one."""
    return go_on(boot_rom.BootRom(flash), image, blocks)


def go_on(rom: boot_rom.BootRom, image: uf2.Image, blocks: int | None = None) -> bool:
    data = image.for_drive()
    each = [data[at : at + uf2.BLOCK] for at in range(0, len(data), uf2.BLOCK)][:blocks]
    restarts = [rom.write(block) for block in each]
    assert not any(restarts[:-1])
    return bool(restarts) and restarts[-1]


def test_a_file_is_read_and_written_back():
    assert uf2.parse(ordinary(GOOD), "it") == GOOD
    assert boot_rom.starts(GOOD.data)
    assert uf2.starts(GOOD.pages[0])


@pytest.mark.parametrize("old", [image(2, 40), image(2, 33), image(2, 90)])
def test_an_update_cut_after_any_block_wakes_up_in_the_boot_loader_and_the_next_one_repairs_it(old):
    whole = flash_with(old)
    assert copy(whole, GOOD)
    assert whole[: len(GOOD.data)] == GOOD.data
    total = len(GOOD.pages) + 1
    for blocks in range(total + 1):
        flash = flash_with(old)
        done = copy(flash, GOOD, blocks)
        assert done == (blocks == total)
        if blocks <= 1:
            assert flash == flash_with(old)  # the old firmware, untouched
        elif not done:
            assert not boot_rom.starts(flash)  # the ROM stays in its boot loader, no button pressed
        assert copy(flash, GOOD)  # power came back, the next flash
        assert flash == whole


def test_an_ordinary_order_would_leave_a_board_that_starts_half_a_firmware():
    flash = flash_with(image(2, 40))
    rom = boot_rom.BootRom(flash)
    data = ordinary(GOOD)
    for at in range(0, 20 * uf2.BLOCK, uf2.BLOCK):
        rom.write(data[at : at + uf2.BLOCK])
    assert boot_rom.starts(flash)


@pytest.mark.parametrize("blocks", [2, 17, 40])
def test_another_firmware_of_the_same_size_after_an_interruption_without_loss_of_power(blocks):
    flash = flash_with(image(2, 40))
    rom = boot_rom.BootRom(flash)
    go_on(rom, image(3, 40), blocks)  # the program was stopped; the chip has been in its boot loader ever since
    assert go_on(rom, GOOD)
    assert flash[: len(GOOD.data)] == GOOD.data


def test_calibration_and_all_other_files_survive():
    flash = flash_with(image(2, 40))
    copy(flash, GOOD)
    at = uf2.FILES_AT - uf2.FLASH_AT
    assert flash[at:] == flash_with(GOOD)[at:]
    most = (uf2.FILES_AT - uf2.FLASH_AT) // uf2.PAGE
    copy(flash, uf2.parse(ordinary(image(4, most)), "the largest"))
    assert flash[at:] == flash_with(GOOD)[at:]
    with pytest.raises(InvalidInput, match="calibration"):
        uf2.parse(ordinary(image(4, most + 1)), "one page more")


def changed(at: int, value: int, block: int = 3) -> bytes:
    data = bytearray(ordinary(GOOD))
    struct.pack_into("<I", data, block * uf2.BLOCK + 4 * at, value)
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "0 bytes"),
        (ordinary(GOOD)[:-1], "not whole blocks"),
        (ordinary(GOOD)[: -uf2.BLOCK], "39"),
        (changed(0, 0), "marks"),
        (changed(1, 0), "marks"),
        (changed(127, 0), "marks"),
        (changed(2, 0), "no chip in particular"),
        (changed(7, 0xE48BFF59), "RP2350"),
        (changed(7, 0xADA52840), "another chip"),
        (changed(3, uf2.FLASH_AT + 0x400), "was due"),
        (changed(3, 0x20000000), "was due"),
        (changed(4, 128), "128 bytes"),
        (changed(5, 4), "there twice|was due"),
        (changed(5, 40), "40 of 40"),
        (changed(6, 41), "3 of 41"),
        (changed(20, 0, block=0), "checksum"),
        (ordinary(GOOD)[: 5 * uf2.BLOCK] + ordinary(GOOD)[4 * uf2.BLOCK : -uf2.BLOCK], "twice"),
    ],
)
def test_what_is_damaged_or_not_for_this_chip_is_refused(data, words):
    with pytest.raises(InvalidInput, match=words) as refusal:
        uf2.parse(data, "it.uf2")
    assert str(refusal.value).startswith("it.uf2 ")


@pytest.mark.medium
@given(st.integers(0, 40 * uf2.BLOCK - 1), st.integers(0, 7))
def test_no_flipped_bit_of_a_header_goes_unseen(at, bit):
    data = bytearray(ordinary(GOOD))
    data[at] ^= 1 << bit
    offset = at % uf2.BLOCK
    try:
        read = uf2.parse(bytes(data), "it")
    except InvalidInput:
        return
    in_flags = 8 <= offset < 12  # other flags mean other things, none of them to us
    in_page = uf2.HEADER.size <= offset < uf2.HEADER.size + uf2.PAGE  # the format has no checksum for it
    in_padding = uf2.HEADER.size + uf2.PAGE <= offset < uf2.BLOCK - 4
    assert in_flags or in_page or in_padding
    assert (read == GOOD) == (not in_page)
    assert not (in_page and at < uf2.BLOCK)  # but for the first page
