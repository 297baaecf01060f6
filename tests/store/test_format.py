"""The format of a record, read and written here with struct and zlib; what is not a good record of this board is not used."""

import struct
import zlib

import pytest

from bubble_firmware.drivers.flash import Files
from bubble_firmware.store import record
from bubble_protocol.schema import errors, store
from bubbleskin.sim.flash import PAGE, SECTOR, NorFlash

PRICE = {"wristband7": 2007, "wristband19": 5331}  # bytes, as docs/store.md has them


def some_record(kit, number, generation, **options):
    device = kit.Device(None)
    content = device.change(number)
    return content, kit.make_record(kit.sections_of(content).values(), generation, **options)


def test_what_is_written_is_what_struct_and_zlib_make(kit):
    flash = NorFlash()
    for number in range(1, 4):
        device = kit.Device(flash)
        content = device.change(number)
        assert device.store.save()
        slot = 1 - number % 2
        wear = (number + 1) // 2, number // 2
        expected = kit.make_record(kit.sections_of(content).values(), number, wear)
        start = slot * flash.size // 2
        assert flash.image[start : start + len(expected)] == expected
        assert set(flash.image[start + len(expected) : start + SECTOR]) == {0xFF}
        assert (device.store.length, device.store.generation, tuple(device.store.wear)) == (len(expected), number, wear)


@pytest.mark.parametrize("name", list(PRICE))
def test_a_record_of_full_tables_has_the_size_of_the_page_on_it(kit, name):
    device = kit.Device(NorFlash(), kit.board(name))
    assert device.store.save()
    assert device.store.length == PRICE[name]


@pytest.mark.parametrize(
    ("first", "second", "newer"), [(1, 2, 1), (7, 6, 0), (65535, 0, 1), (0, 65535, 0), (65000, 100, 1), (5, 5, 0)]
)
def test_the_newer_one_is_used_over_the_wrap(kit, first, second, newer):
    slots = [some_record(kit, 10, first), some_record(kit, 20, second)]
    device = kit.Device(kit.flash_with(slots[0][1], slots[1][1]))
    assert device.content == slots[newer][0]
    assert device.store.source == store.SLOT_A + newer
    assert device.store.generation == (first, second)[newer]


@pytest.mark.promise("store-told")
def test_nothing_stored_is_factory(kit):
    device = kit.Device(NorFlash())
    assert device.store.source == store.FACTORY
    assert device.content == kit.FACTORY_CONTENT


@pytest.mark.medium
@pytest.mark.parametrize("good", [0, 1, None])
def test_a_bit_lost_anywhere_is_noticed(kit, good):
    (one, a), (two, b) = some_record(kit, 10, 1), some_record(kit, 20, 2)
    for bit in range(0, 8 * min(len(a), len(b)), 5):
        flash = kit.flash_with(a, b)
        for slot in range(2):
            if slot != good:
                flash.image[slot * flash.size // 2 + bit // 8] ^= 1 << bit % 8
        device = kit.Device(flash)
        assert device.content == {0: one, 1: two, None: kit.FACTORY_CONTENT}[good]
        assert device.store.source == {0: store.SLOT_A, 1: store.SLOT_B, None: store.DAMAGED}[good]
        device.change(30)
        assert device.store.save()
        if good is not None:
            assert kit.Device(flash).store.states[good] == store.SLOT_VALID, "the good one has not been touched"


@pytest.mark.promise("store-versions")
def test_a_newer_schema_is_left_alone_until_a_reset(kit):
    old, older = some_record(kit, 10, 1)
    _, newer = some_record(kit, 20, 2, schema=record.SCHEMA + 1)
    for flash, source, content in (
        (kit.flash_with(older, newer), store.SLOT_A, old),
        (kit.flash_with(newer), store.FOREIGN, kit.FACTORY_CONTENT),
    ):
        before = bytes(flash.image)
        device = kit.Device(flash)
        assert (device.store.source, device.content) == (source, content)
        device.change(30)
        assert not device.store.save()
        assert device.store.error == errors.STORE_FOREIGN
        assert flash.image == before
        assert device.store.reset()
        assert kit.Device(flash).store.source == store.FACTORY
        device.change(30)
        assert device.store.save()


@pytest.mark.promise("store-versions")
def test_another_boards_record_is_left_alone(kit):
    _, other = some_record(kit, 10, 1, name="wristband19")
    device = kit.Device(kit.flash_with(b"", other))
    assert device.store.source == store.FOREIGN
    assert device.content == kit.FACTORY_CONTENT
    assert not device.store.save()


@pytest.mark.promise("store-versions")
def test_an_older_schema_lacks_what_has_been_added_since(kit):
    device = kit.Device(None)
    tables, trim, settings = device.change(10)
    factory_tables, factory_trim, factory_settings = kit.FACTORY_CONTENT
    whole = kit.sections_of((tables, trim, settings))
    shorter = kit.sections_of((tables, trim[:2], settings[:1]))
    for sections, expected in (
        ((whole[1],), (tables, factory_trim, factory_settings)),
        ((whole[3], whole[1]), (tables, trim, factory_settings)),
        (
            (shorter[1], shorter[2], shorter[3]),
            (tables, trim[:2] + factory_trim[2:], settings[:1] + factory_settings[1:]),
        ),
        ((whole[2],), (factory_tables, factory_trim, settings)),
    ):
        flash = kit.flash_with(kit.make_record(sections, 9, schema=record.SCHEMA - 1))
        device = kit.Device(flash)
        assert device.content == expected
        assert device.store.source == store.SLOT_A
        assert device.store.save(), "and is written anew in today's schema"
        again = kit.Device(flash)
        assert (again.content, again.store.schema, again.store.generation) == (expected, record.SCHEMA, 10)


@pytest.mark.promise("store-limits")
def test_what_the_board_does_not_allow_is_not_used(kit):
    device = kit.Device(None)
    tables, trim, settings = device.change(10)
    older = kit.make_record(kit.sections_of(device.content).values(), 1)
    high = struct.pack("<HHHH", 4000, 0, 14000, 42001).hex()
    short = struct.pack("<HHHH", 4000, 0, 13999, 40000).hex()
    falling = struct.pack("<HHHHHH", 4000, 0, 3000, 10, 14000, 20).hex()
    for unfit in (
        *(((table,), trim, settings) for table in (high, short, falling, "00000000")),
        *((tables, (zero, *trim[1:]), settings) for zero in (160 + 89, 160 - 89)),
        (tables, (trim[0], 2501, *trim[2:]), settings),
        (tables, (*trim[:3], 3984 * 4 + 1, *trim[4:]), settings),
        (tables, trim, (-1, *settings[1:])),
    ):
        newer = kit.make_record(kit.sections_of(unfit).values(), 2)
        alone = kit.Device(kit.flash_with(newer))
        assert (alone.store.source, alone.content) == (store.DAMAGED, kit.FACTORY_CONTENT)
        assert alone.store.states[0] == store.SLOT_REJECTED
        flash = kit.flash_with(older, newer)
        both = kit.Device(flash)
        assert (both.store.source, both.content) == (store.SLOT_A, (tables, trim, settings))
        last = both.change(30)
        assert both.store.save()
        assert (kit.Device(flash).content, kit.Device(flash).store.generation) == (last, 3)


def test_sections_that_lie_about_their_length_are_not_used(kit):
    device = kit.Device(None)
    sections = kit.sections_of(device.change(10))
    for data in (
        b"\x01\0\xff\xff" + sections[1][4:],
        sections[1][:-4],
        sections[1][:5],
        b"\x01\0\x01\x00\x40",
    ):
        device = kit.Device(kit.flash_with(kit.make_record((data,), 1)))
        assert (device.store.source, device.content) == (store.DAMAGED, kit.FACTORY_CONTENT)
    # A length beyond the slot, and one below a header, each with CRCs that fit.
    for length in (0, 43, 100_000, 0xFFFFFFFF):
        whole = kit.make_record(sections.values(), 1)
        head = whole[:8] + struct.pack("<I", length) + whole[12:36]
        head += struct.pack("<I", zlib.crc32(head))
        assert kit.Device(kit.flash_with(head + whole[40:])).store.source == store.DAMAGED


@pytest.mark.promise("no-needless-wear")
def test_what_is_saved_already_is_not_written_again(kit):
    flash = NorFlash()
    device = kit.Device(flash)
    for number in (1, 2):
        device.change(number)
        for _ in range(3):
            assert device.store.save()
    assert kit.Device(flash).store.save()
    assert sum(flash.erases) == 2


@pytest.mark.promise("no-needless-wear")
@pytest.mark.medium
def test_wear_is_what_the_chip_counts(kit):
    flash = NorFlash()
    for number in range(1, 200):
        device = kit.Device(flash)
        device.change(number)
        assert device.store.save() if number % 7 else device.store.reset()
    assert list(device.store.wear) == [flash.erases[0], flash.erases[4]]


def test_flash_that_does_not_take_it_is_told(kit):
    class Worn(NorFlash):
        """A byte of the second slot stands at 0."""

        def read(self, offset, page):
            super().read(offset, page)
            if offset == self.size // 2 + PAGE:
                page[9] = 0

    flash = Worn()
    device = kit.Device(flash)
    old = device.change(1)
    assert device.store.save()
    device.change(60)
    assert not device.store.save()
    assert device.store.error == errors.STORE_FAILED
    assert kit.Device(flash).content == old


def test_without_flash_there_is_no_store(kit):
    device = kit.Device(None)
    assert device.store.source == store.NO_STORE
    assert not device.store.save()
    assert not device.store.reset()
    assert device.store.error == errors.STORE_FAILED


def test_files_do_as_well(kit, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    calls = []
    chip = NorFlash()
    for number in range(1, 5):
        for flash in (Files(lambda: calls.append(1)), chip):
            device = kit.Device(flash)
            assert device.store.source == (store.FACTORY if number == 1 else store.SLOT_A + number % 2)
            content = device.change(number)
            assert device.store.save()
            assert kit.Device(flash).content == content
    assert len(calls) == chip.operations
    for path in tmp_path.iterdir():
        sector = int(path.stem.split("-")[1])
        assert path.read_bytes() == chip.image[sector * SECTOR :][:SECTOR]


def test_the_file_of_a_simulated_flash_keeps_it(kit, tmp_path):
    path = tmp_path / "flash.bin"
    content = kit.Device(NorFlash(path=path)).content
    device = kit.Device(NorFlash(path=path))
    content = device.change(5)
    assert device.store.save()
    assert kit.Device(NorFlash(path=path)).content == content
