"""UF2 files for the RP2040: what is checked before one goes onto a board, and in which order its blocks go.

A UF2 is a row of blocks of 512 bytes (github.com/microsoft/uf2): a header of eight words, 256 bytes for one page of
flash, a closing word. The boot ROM writes each page as it comes and starts the firmware when all have come.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import crcmod

from bubbleskin.errors import InvalidInput
from bubbleskin.files import read_bytes

BLOCK, PAGE = 512, 256
HEADER = struct.Struct("<8I")
CLOSING = struct.Struct("<I")
MAGIC = (0x0A324655, 0x9E5D5157)
MAGIC_END = 0x0AB16F30
HAS_FAMILY, NOT_FLASH = 0x2000, 0x1
RP2040 = 0xE48BFF56
OTHERS = {0xE48BFF59: "an RP2350", 0xE48BFF5A: "an RP2350", 0xE48BFF5B: "an RP2350"}

FLASH_AT = 0x10000000
FILES_AT = FLASH_AT + 0xA0000
"""Where MicroPython's file system begins on a Pico: the last 1408 KiB of 2 MiB. Calibration is in it."""

_boot2_crc = crcmod.mkCrcFun(0x104C11DB7, initCrc=0xFFFFFFFF, rev=False, xorOut=0)


@dataclass(frozen=True)
class Image:
    """A firmware as pages in the order of their addresses, without a gap, from the beginning of flash."""

    pages: tuple[bytes, ...]

    @property
    def data(self) -> bytes:
        """What stands in flash once all of it has been written."""
        return b"".join(self.pages)

    def for_drive(self) -> bytes:
        """The file to copy onto the boot loader's drive: the pages, the very first of them last.

        The ROM starts what it finds only if the checksum of the first page is right, and it erases that page with
        the others of its sector. So from the second page on until the last block has come, an interrupted board
        wakes up in the boot loader, with no button pressed. The block in front of all is one for an update of no
        blocks: it makes the ROM forget an update that has been broken off, of which it would keep the pages.
        """
        n = len(self.pages)
        order = [*range(1, n), 0]
        return block(0, 0, FLASH_AT, bytes(PAGE)) + b"".join(
            block(number, n, FLASH_AT + PAGE * number, self.pages[number]) for number in order
        )


def block(number: int, count: int, address: int, page: bytes) -> bytes:
    """Block `number` of `count`: 256 bytes for `address`."""
    header = HEADER.pack(*MAGIC, HAS_FAMILY, address, PAGE, number, count, RP2040)
    return (header + page).ljust(BLOCK - CLOSING.size, b"\0") + CLOSING.pack(MAGIC_END)


def starts(first_page: bytes) -> bool:
    """Whether the boot ROM takes this first page for a program's (RP2040 datasheet, 2.8.1.3.1)."""
    return len(first_page) == PAGE and _boot2_crc(first_page[:-4]) == CLOSING.unpack(first_page[-4:])[0]


def read(path: Path) -> Image:
    """The image in the file at `path`; `InvalidInput` where it is damaged, or not for this board."""
    return parse(read_bytes(path, "the firmware"), str(path))


def parse(data: bytes, name: str) -> Image:
    """The image in `data`; `name` is what the sentences call it."""
    damaged = f"{name} is damaged or no UF2 file"
    remedy = "Build or download it again; nothing has been written."
    if not data or len(data) % BLOCK:
        raise InvalidInput(f"{damaged}: {len(data)} bytes are not whole blocks of {BLOCK}. {remedy}")
    pages: dict[int, bytes] = {}
    count = len(data) // BLOCK
    for at in range(0, len(data), BLOCK):
        magic0, magic1, flags, address, size, number, total, family = HEADER.unpack_from(data, at)
        (end,) = CLOSING.unpack_from(data, at + BLOCK - CLOSING.size)
        where = f"block {at // BLOCK}"
        if (magic0, magic1) != MAGIC or end != MAGIC_END:
            raise InvalidInput(f"{damaged}: {where} has not the marks of one. {remedy}")
        if not flags & HAS_FAMILY or family != RP2040:
            kind = OTHERS.get(family, "another chip") if flags & HAS_FAMILY else "no chip in particular"
            raise InvalidInput(
                f"{name} is made for {kind}, and the wristband has an RP2040. Take a file that is made for it, "
                "such as that of `bubbleskin firmware build`."
            )
        if flags & NOT_FLASH or size != PAGE or address % PAGE or total != count or number >= count:
            raise InvalidInput(f"{damaged}: {where} of {count} says it is {number} of {total}, {size} bytes. {remedy}")
        if number in pages:
            raise InvalidInput(f"{damaged}: block number {number} is there twice. {remedy}")
        if address != FLASH_AT + PAGE * number:
            raise InvalidInput(
                f"{damaged}: {where} goes to {address:#x}, and {FLASH_AT + PAGE * number:#x} was due. {remedy}"
            )
        pages[number] = data[at + HEADER.size : at + HEADER.size + PAGE]
    if FLASH_AT + PAGE * count > FILES_AT:
        room = (FILES_AT - FLASH_AT) // 1024
        raise InvalidInput(
            f"{name} holds {PAGE * count // 1024} KiB, and the files of the board, its calibration among them, begin "
            f"after {room} KiB. Build a smaller firmware."
        )
    if not starts(pages[0]):
        raise InvalidInput(f"{damaged}: its first page has a wrong checksum, and the chip would not start it. {remedy}")
    return Image(tuple(pages[number] for number in range(count)))
