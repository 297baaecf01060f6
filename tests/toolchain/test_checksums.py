"""What the firmware is built of: known by name and content, or not used."""

import hashlib

import pytest

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.checksums import SHA256, verify

NAME = "source_1.0.tar.xz"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / NAME
    path.write_bytes(b"as it should be")
    return path


def test_a_file_that_is_known_is_used(file):
    verify(file, {NAME: hashlib.sha256(b"as it should be").hexdigest()})


def test_one_byte_that_differs_is_found(file):
    known = {NAME: hashlib.sha256(b"as it should be").hexdigest()}
    file.write_bytes(b"as it should bE")
    with pytest.raises(BubbleskinError, match=r"source_1\.0\.tar\.xz is not what we build of: its SHA-256 should be"):
        verify(file, known)


def test_a_file_that_nobody_has_looked_at_is_not_used(file):
    with pytest.raises(BubbleskinError, match="nobody has looked at it"):
        verify(file)


def test_all_that_is_fetched_has_a_checksum():
    assert [len(sha) for sha in SHA256.values()] == [64] * 5
    assert {name.split("_")[0] for name in SHA256} == {"micropython", "pico-sdk-source", "tinyusb-source"}
