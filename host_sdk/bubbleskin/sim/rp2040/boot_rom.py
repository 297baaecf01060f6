"""What the RP2040's boot ROM does with the UF2 blocks that are written to its drive, and how it decides what to start.

Written after the behaviour of the ROM's published source, `virtual_disk.c` (raspberrypi/pico-bootrom-rp2040), and the
datasheet, 2.8.1 and 2.8.4. The emulator has the ROM's code but no USB mass storage for it to serve.
"""

import struct

_HEADER = struct.Struct("<8I")
_BLOCK, _PAGE, _SECTOR = 512, 256, 4096
_FLASH_AT, _FLASH_END = 0x10000000, 0x11000000
_FAMILY, _HAS_FAMILY, _NOT_FLASH = 0xE48BFF56, 0x2000, 0x1

INFO = "UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: RPI-RP2\n"
"""The content of INFO_UF2.TXT."""


class BootRom:
    """The boot loader of a chip whose flash is `flash`, which it changes in place; new at every reset."""

    def __init__(self, flash: bytearray):
        self.flash = flash
        self._total = 0
        self._taken: set[int] = set()
        self._erased: set[int] = set()

    def write(self, block: bytes) -> bool:
        """Take one sector of 512 bytes that was written to the drive; whether the chip restarts now."""
        magic0, magic1, flags, address, size, number, total, family = _HEADER.unpack_from(block)
        (end,) = struct.unpack_from("<I", block, _BLOCK - 4)
        if (magic0, magic1, end) != (0x0A324655, 0x9E5D5157, 0x0AB16F30):
            return False  # a sector of the file system, or a foreign file's
        if not flags & _HAS_FAMILY or family != _FAMILY or flags & _NOT_FLASH or size != _PAGE:
            return False
        if not total or not _FLASH_AT <= address < _FLASH_END or address % _PAGE:
            self._total = 0
            return False
        if total != self._total:
            self._total = total
            self._taken.clear()
            self._erased.clear()
        if number >= total:
            self._total = 0
            return False
        if number in self._taken:  # also one of an update that was broken off: its old content stays
            return False
        at = address - _FLASH_AT
        sector = number * _PAGE // _SECTOR
        if sector not in self._erased:
            self._erased.add(sector)
            start = at // _SECTOR * _SECTOR
            self.flash[start : start + _SECTOR] = b"\xff" * _SECTOR
        page = block[_HEADER.size : _HEADER.size + _PAGE]
        old = self.flash[at : at + _PAGE]
        self.flash[at : at + _PAGE] = bytes(a & b for a, b in zip(old, page, strict=True))  # programming only clears
        self._taken.add(number)
        return len(self._taken) == total


def starts(flash: bytes | bytearray) -> bool:
    """Whether the ROM starts what is in flash: the first 252 bytes have the CRC-32 that the next four say."""
    crc = 0xFFFFFFFF
    for byte in flash[: _PAGE - 4]:
        crc ^= byte << 24
        for _ in range(8):
            crc = crc << 1 ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1
    return struct.unpack_from("<I", flash, _PAGE - 4)[0] == crc & 0xFFFFFFFF
