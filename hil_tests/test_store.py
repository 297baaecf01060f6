"""What has been saved is there after a restart; what has not is not."""

import pytest

import bubbleskin as bs

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.not_on("board", "a restart of a real board ends its port: done by hand, see docs/store.md"),
]


@pytest.fixture
def stored(skin):
    """A wristband that may be saved to: what it had stored is stored again in the end."""
    tables = skin.read_tables()
    yield skin
    skin.vent()
    skin.upload_tables(tables, save=True)


def restart(skin):
    skin.restart()
    skin.sleep(2.0)  # a chip takes a while to appear on USB again


@pytest.mark.promise("saved-stays")
@pytest.mark.long
def test_saved_tables_are_in_use_after_a_restart(stored):
    skin = stored
    for top_kpa in (34, 36):  # both records are of others
        skin.upload_tables(bs.Table([4000, 14000], [0, 1000 * top_kpa]), save=True, anyway=True)
    before = skin.stored()
    ours = bs.Table([4000, 9000, round(skin.info.height_max_mm * 1000)], [0, 21000, 35000])
    skin.upload_tables(ours, save=True)
    info = skin.stored()
    assert info.generation == (before.generation + 1) % 65536
    assert sum(info.wear) == sum(before.wear) + 1
    skin.upload_tables(bs.Table([4000, 14000], [0, 30000]), anyway=True)  # not saved
    restart(skin)
    assert skin.read_tables() == [ours] * skin.info.bubbles
    assert skin.stored() == info
    assert skin.health().store == info.source
    assert skin.health().exceptions == 0


@pytest.mark.promise("saved-stays")
@pytest.mark.long
def test_a_shape_is_held_as_before(stored):
    skin = stored
    skin.save()
    restart(skin)
    state = skin.show([6.0] * skin.info.bubbles)
    assert abs(state.height_mm - 6.0).max() < 0.2


@pytest.mark.promise("vented-only")
@pytest.mark.long
def test_saving_is_refused_while_a_shape_is_held(stored):
    skin = stored
    skin.show([6.0] * skin.info.bubbles)
    with pytest.raises(bs.DeviceRefused, match="not vented"):
        skin.save()


@pytest.mark.promise("no-needless-wear", "store-told")
@pytest.mark.long
def test_what_is_saved_already_is_not_written_again(stored):
    skin = stored
    skin.save()
    before = skin.stored()
    skin.save()
    assert skin.stored() == before
    assert before.source == skin.health().store in {"slot_a", "slot_b"}
