# mypy: disable-error-code="no-redef"
"""CRC-32 (IEEE 802.3, as in zlib) written straight into a buffer.

MicroPython's `binascii.crc32` returns a long integer for three values in four, and a long integer is an
allocation. The tick must not allocate, so the device runs this instead; the host calls crcmod. The
tests hold crcmod, zlib, binascii and this against each other.
On CPython, where a loop over bytes is slow, the same functions are zlib's.
"""

from array import array

from bubble_protocol.mpy_compat import COMPILED, TYPE_CHECKING, micropython, ptr8, ptr32

if TYPE_CHECKING:
    from bubble_protocol.mpy_compat import Buffer

_POLYNOMIAL_LOW, _POLYNOMIAL_HIGH = 0x8320, 0xEDB8  # 0xEDB88320, bits reversed


def _table() -> "array[int]":
    """The 256 remainders, as signed words: viper has no unsigned ones."""
    table = array("i", bytearray(4 * 256))
    for byte in range(256):
        low, high = byte, 0  # two halves keep every step within MicroPython's 31-bit small integers
        for _ in range(8):
            carry = low & 1
            low = low >> 1 | (high & 1) << 15
            high >>= 1
            if carry:
                low ^= _POLYNOMIAL_LOW
                high ^= _POLYNOMIAL_HIGH
        table[byte] = ((high ^ 0x8000) - 0x8000) * 65536 + low
    return table


TABLE = _table()


@micropython.viper
def _crc32_into(table, buffer, start: int, end: int, out, at: int):  # type: ignore[no-untyped-def]
    words = ptr32(table)
    data = ptr8(buffer)
    crc = -1
    index = start
    while index < end:
        crc = (crc >> 8 & 0xFFFFFF) ^ words[(crc ^ data[index]) & 255]
        index += 1
    crc = ~crc
    result = ptr8(out)
    result[at] = crc & 255
    result[at + 1] = crc >> 8 & 255
    result[at + 2] = crc >> 16 & 255
    result[at + 3] = crc >> 24 & 255


def crc32_into(buffer: "Buffer", start: int, end: int, out: bytearray, at: int) -> None:
    """Write the CRC-32 of `buffer[start:end]` to `out[at:at + 4]`, low byte first. Allocates nothing."""
    _crc32_into(TABLE, buffer, start, end, out, at)


@micropython.viper
def _crc32_on(table, buffer, start: int, end: int, word):  # type: ignore[no-untyped-def]
    words = ptr32(table)
    data = ptr8(buffer)
    state = ptr32(word)
    crc = ~state[0]
    while start < end:
        crc = (crc >> 8 & 0xFFFFFF) ^ words[(crc ^ data[start]) & 255]
        start += 1
    state[0] = ~crc


def crc32_on(buffer: "Buffer", start: int, end: int, word: "array[int]") -> None:
    """Go on with the CRC-32 in `word[0]`, of an `array('i')`, over `buffer[start:end]`; it begins at 0. Allocates nothing."""
    _crc32_on(TABLE, buffer, start, end, word)


if not COMPILED:
    import zlib

    def crc32_into(buffer: "Buffer", start: int, end: int, out: bytearray, at: int) -> None:
        """As above."""
        out[at : at + 4] = zlib.crc32(memoryview(buffer)[start:end]).to_bytes(4, "little")

    def crc32_on(buffer: "Buffer", start: int, end: int, word: "array[int]") -> None:
        """As above."""
        crc = zlib.crc32(memoryview(buffer)[start:end], word[0] & 0xFFFFFFFF)
        word[0] = crc - (crc >> 31 << 32)


def crc32_word(buffer: "Buffer", start: int, end: int) -> int:
    """The same CRC as one signed word, the way `array('i')` holds it."""
    crc = bytearray(4)
    crc32_into(buffer, start, end, crc, 0)
    return ((crc[3] ^ 128) - 128) * 16777216 + (crc[2] << 16 | crc[1] << 8 | crc[0])
