"""The store over the wire: when it may be written, what is said of it, and what survives a restart."""

import dataclasses

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol import codec
from bubble_protocol.schema import system
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.flash import NorFlash, PowerCut
from bubbleskin.sim.transport import SimulatedTransport


def open_board(**options):
    board = SimulatedBoard(**options)
    return bs.Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, "sim://wristband7"), 2.0, simulated=board)))


@pytest.fixture
def skin():
    return open_board()


def lose_power(skin):
    """Power fails and comes back; the SDK says so once, then goes on."""
    skin.simulated.reset()
    with pytest.raises(bs.DeviceRestarted):
        skin.state()


TABLE = bs.Table([4000, 9000, 14000], [0, 21000, 35000])


@pytest.mark.promise("saved-stays")
def test_what_is_saved_is_there_after_a_power_cut_and_what_is_not_is_not(skin):
    factory = skin.read_tables()
    assert skin.health().store == skin.stored().source == "factory"
    skin.upload_tables(TABLE)
    assert skin.stored().tables_crc != skin.health().tables_crc, "in use, and not saved"
    lose_power(skin)
    assert skin.read_tables() == factory
    skin.upload_tables(TABLE, save=True)
    lose_power(skin)
    assert skin.read_tables() == [TABLE] * 7
    assert skin.health().store == skin.stored().source == "slot_a"
    skin.factory_reset()
    assert skin.read_tables() == factory
    lose_power(skin)
    assert skin.read_tables() == factory
    assert (skin.health().store, skin.stored().slots) == ("factory", ("valid", "valid"))


def test_power_may_fail_while_the_host_waits():
    for operation in range(3):
        flash = NorFlash()
        skin = open_board(flash=flash)
        skin.upload_tables(TABLE)
        flash.cut(operation, lambda before, after: after)
        with pytest.raises(PowerCut):
            skin.save()
        lose_power(skin)
        whole = operation == 2  # the page with the header
        assert (skin.read_tables() == [TABLE] * 7) == whole
        assert skin.health().store == ("slot_a" if whole else "factory")
        skin.upload_tables(TABLE, save=True)


@pytest.mark.promise("vented-only")
@pytest.mark.parametrize("ask", [bs.Skin.save, bs.Skin.factory_reset, lambda skin: skin.upload_trim(skin.trim())])
def test_only_while_vented(skin, ask):
    flash = skin.simulated.firmware.flash
    skin.show([6.0] * 7)
    with pytest.raises(bs.DeviceRefused, match=r"because it is active, not vented\. Call `vent\(\)` first"):
        ask(skin)
    skin.stop()
    with pytest.raises(bs.DeviceRefused, match="because it is holding, not vented"):
        ask(skin)
    assert not flash.operations
    skin.vent()
    ask(skin)


@pytest.mark.promise("vented-only")
def test_a_save_leaves_the_valves_safe_and_the_next_show_works(skin):
    skin.save()
    assert (skin.simulated.pulses == [0.0, skin.info.tick]).all()
    state = skin.show([8.0] * 7)
    assert np.abs(state.height_mm - 8.0).max() < 0.2
    assert skin.health().exceptions == 0


@pytest.mark.promise("store-told")
def test_both_slots_bad_is_said():
    flash = NorFlash()
    skin = open_board(flash=flash)
    factory = skin.read_tables()
    skin.upload_tables(TABLE, save=True)
    skin.upload_tables(factory, save=True)
    skin.upload_tables(TABLE, save=True)
    for slot in range(2):
        flash.image[slot * flash.size // 2 + 60] ^= 4
    lose_power(skin)
    assert skin.health().store == skin.stored().source == "damaged"
    assert skin.stored().slots == ("corrupt", "corrupt")
    assert skin.read_tables() == factory
    skin.save()
    assert skin.health().store == "slot_a"


@pytest.mark.promise("store-told", "store-versions")
def test_refusals_are_sentences():
    flash = NorFlash()
    open_board(flash=flash).save()
    skin = open_board(board="wristband19", flash=flash)
    assert skin.health().store == "foreign"
    with pytest.raises(bs.DeviceRefused, match=r"another board has saved\. Update the firmware, or .* `factory_reset"):
        skin.save()
    assert skin.stored().error == "store_foreign"
    skin.factory_reset()
    skin.save()
    assert not skin.stored().error
    flash.erase = lambda offset: None  # a chip that no longer erases
    with pytest.raises(bs.DeviceRefused, match="flash does not hold what was written"):
        skin.upload_tables(TABLE, save=True)
    assert skin.stored().error == "store_failed"


def test_figures_are_used_kept_and_checked(skin):
    n = skin.info.bubbles
    made_with = skin.trim()
    other = dataclasses.replace(made_with, zero=made_with.zero + np.arange(n), closes_us=made_with.closes_us - 200)
    skin.upload_trim(other, save=True)
    lose_power(skin)
    assert all((getattr(skin.trim(), name) == getattr(other, name)).all() for name in vars(other))
    skin.sleep(0.1)  # zeros that are higher read lower pressures
    assert np.allclose(np.diff(skin.state().pressure_kpa).mean(), -0.017, atol=0.03)
    for name, value, allowed in (
        ("zero", 300, "72 to 248"),
        ("opens_us", 2501, "0 to 2500"),
        ("flow_gain", 9, "2988 to 5312"),
    ):
        values = getattr(made_with, name).copy()
        values[3] = value
        with pytest.raises(bs.DeviceRefused, match=rf"entry 3.* is {value}.*; {allowed}"):
            skin.upload_trim(dataclasses.replace(made_with, **{name: values}), anyway=True)
    for wrong, said in (
        ([160] * (n - 1), "one number for each of 7 bubbles"),
        ([160.5] * n, "must be whole numbers"),
        ([-1] * n, "numbers from 0 to 65535"),
    ):
        with pytest.raises(bs.InvalidInput, match=said):
            skin.upload_trim(dataclasses.replace(made_with, zero=np.array(wrong)))
    assert (skin.trim().zero == other.zero).all()


def test_a_store_in_a_file_outlives_the_program(tmp_path):
    url = f"sim://wristband7?store={tmp_path / 'flash.bin'}"
    with bs.connect(url) as skin:
        skin.upload_tables(TABLE, save=True)
    with bs.connect(url) as skin:
        assert skin.read_tables() == [TABLE] * 7
    (tmp_path / "flash.bin").write_bytes(b"short")
    with pytest.raises(bs.InvalidInput, match="has 5 bytes, but the simulated flash 32768"):
        bs.connect(url)
    for wrong in ("sim://wristband7?store=", "micropython://wristband7?store=x"):
        with pytest.raises(bs.InvalidInput, match="store="):
            bs.connect(wrong)


def test_the_capability_is_announced():
    hello = codec.BY_NAME["HELLO_REPLY"]
    assert "capabilities" in [field[0] for field in hello.fixed]
    assert "store" in [name for bit, name, _ in system.CAPABILITIES if bit == system.STORE]
