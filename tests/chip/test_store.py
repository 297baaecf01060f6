"""The store on the emulated chip: MicroPython's flash driver, the boot ROM's functions and the chip's commands, for real."""

import pytest

import bubbleskin as bs

pytestmark = pytest.mark.chip

TABLE = bs.Table([4000, 9000, 14000], [0, 21000, 35000])
STORE_AT = (2048 - 1408 - 32) * 1024
SLOT = 16 * 1024


def reboot(skin):
    """Until the chip is on USB again, and the SDK has told that it has restarted."""
    board = skin.simulated
    resets = board.chip.resets
    while board.chip.resets == resets:
        board.tick()
    board.boot()

    def ask():
        for _ in range(30):
            skin.sleep(0.1)
            skin.state()

    with pytest.raises(bs.DeviceRestarted):
        ask()


@pytest.mark.promise("saved-stays")
@pytest.mark.parametrize("name", ["wristband7", pytest.param("wristband19", marks=pytest.mark.long)])
def test_saved_tables_outlive_the_watchdog(emulated, name):
    skin = emulated(name)
    board = skin.simulated
    flash = board.chip.mcu.flash
    program = bytes(flash[:STORE_AT])
    files = bytes(flash[STORE_AT + 2 * SLOT : 2 << 20])
    assert skin.health().store == "factory"
    full = skin.save()  # tables of 64 knots
    assert (full.source, full.generation, full.slots, full.wear) == ("slot_a", 1, ("valid", "blank"), (1, 0))
    assert bytes(flash[STORE_AT : STORE_AT + 4]) == b"bsst"
    skin.upload_tables(TABLE)
    before = skin.health()
    info = skin.save()
    assert (info.source, info.generation, info.slots, info.wear) == ("slot_b", 2, ("valid", "valid"), (1, 1))
    after = skin.health()
    assert (after.exceptions, after.heap_free, after.late_ticks) == (0, before.heap_free, before.late_ticks)
    assert bytes(flash[STORE_AT + SLOT : STORE_AT + SLOT + 4]) == b"bsst"
    board.inject("hang")
    reboot(skin)
    health = skin.health()
    assert "watchdog" in health.board_faults
    assert health.store == "slot_b"
    assert skin.stored() == info
    assert skin.read_tables() == [TABLE] * skin.info.bubbles
    assert bytes(flash[:STORE_AT]) == program
    assert bytes(flash[STORE_AT + 2 * SLOT : 2 << 20]) == files, "nor has the file system been touched"
    print(f"{name}: {full.size} bytes, {after.heap_free} bytes of heap free, wear {info.wear}")
