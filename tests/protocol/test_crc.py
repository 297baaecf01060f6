"""One CRC-32: the device's, crcmod's, zlib's and binascii's."""

import binascii
import zlib

import crcmod.predefined
from hypothesis import given
from hypothesis import strategies as st

from bubble_protocol.crc import crc32_into, crc32_word
from bubbleskin.link import message

crcmod_crc32 = crcmod.predefined.mkPredefinedCrcFun("crc-32")


@given(st.binary(max_size=300), st.integers(0, 20), st.integers(0, 20), st.integers(0, 5))
def test_all_agree(data, before, after, at):
    out = bytearray(b"\xaa" * 9)
    buffer = bytearray(b"\x55" * before + data + b"\x55" * after)
    crc32_into(buffer, before, before + len(data), out, at)
    crc = int.from_bytes(out[at : at + 4], "little")
    assert crc == zlib.crc32(data) == binascii.crc32(data) == crcmod_crc32(data) == message.crc32(data)
    assert out[:at] + out[at + 4 :] == b"\xaa" * 5
    assert crc32_word(buffer, before, before + len(data)) == crc - (crc >> 31 << 32)


def test_the_check_value_of_the_catalogue():
    assert crc32_word(b"123456789", 0, 9) == 0xCBF43926 - (1 << 32)


def test_the_device_agrees_with_its_own_binascii(micropython):
    said = micropython(
        """
        import binascii, random
        from bubble_protocol.crc import crc32_into, crc32_word
        random.seed(1)
        wrong = 0
        high = 0
        for n in range(2000):
            data = bytes(random.getrandbits(8) for _ in range(n % 300))
            crc = binascii.crc32(data)
            out = bytearray(9)
            crc32_into(b"xyz" + data, 3, 3 + len(data), out, n % 5)
            high += crc >> 31
            wrong += out[n % 5 : n % 5 + 4] != crc.to_bytes(4, "little")
            wrong += crc32_word(data, 0, len(data)) != crc - (crc >> 31 << 32)
        print(wrong, high > 900)
        """
    )
    assert said.split() == ["0", "True"]
