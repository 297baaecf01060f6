"""Tops where bubbles touch: shown, told and bounded, judged by where the simulated bubbles truly stand."""

import itertools
import logging

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.bench.control import touching

CROWDED = "sim://wristband7"
LIFTED = np.array([12.5, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0])
ORDERED = np.array([12.6, 11.0, 11.0, 11.0, 11.0, 11.0, 11.0])
"""Only with the middle first, and then by one who knows what the others do to it."""
HELD_MM = 0.1
"""What a wristband holds heights to."""


@pytest.fixture
def skin():
    with bs.connect(CROWDED) as skin:
        yield skin


@pytest.mark.parametrize(
    "asked", [LIFTED, ORDERED, np.linspace(6.0, 13.0, 7).round(3)], ids=["lifted", "ordered", "stairs"]
)
def test_tops_are_where_they_were_asked(skin, asked):
    state = skin.show(asked)
    assert skin.simulated.height_mm == pytest.approx(asked, abs=0.15)
    assert state.height_mm == pytest.approx(skin.simulated.height_mm, abs=0.15)
    assert state.alone_mm == pytest.approx(skin.simulated.alone_mm, abs=0.1)
    assert state.target_mm == pytest.approx(asked)


def test_raw_heights_are_of_each_bubble_by_itself(skin):
    state = skin.show(LIFTED, plan=False)
    assert skin.simulated.alone_mm == pytest.approx(LIFTED, abs=0.1)
    assert skin.simulated.height_mm[0] > 13.0
    assert state.height_mm == pytest.approx(skin.simulated.height_mm, abs=0.15)
    assert state.status[0] == "missed"
    assert not state.settled
    assert state.arrived


@pytest.mark.slow
@pytest.mark.parametrize("rubber", ["ideal", "real"])
def test_planned_is_nearer_than_raw(rubber):
    """Shapes that a wristband has had: planned tops are where they were asked, raw ones are not."""
    rng = np.random.default_rng(2)
    off = {True: [], False: []}
    with bs.connect(f"{CROWDED}?rubber={rubber}") as skin:
        for _ in range(6):
            flat(skin)
            skin.show(rng.uniform(7.0, 12.5, 7), over=0.5, wait=False, plan=False)
            skin.sleep(1.5)
            had = skin.simulated.height_mm.copy()
            if had.max() > 13.0 or np.abs(had - skin.simulated.alone_mm).max() < 0.3:
                continue
            for plan, errors in off.items():
                flat(skin)
                skin.show(had, over=0.5, wait=False, plan=plan)
                skin.sleep(3.0)
                errors.append(skin.simulated.height_mm - had)
    assert len(off[True]) >= 2
    planned, raw = (np.sqrt(np.mean(np.square(off[plan]))) for plan in (True, False))
    assert planned < 0.2
    assert raw > 2 * planned


def flat(skin):
    skin.vent()
    skin.sleep(1.5)
    if skin.faults():
        skin.clear_faults()


@pytest.mark.promise("height-neighbours")
@pytest.mark.parametrize(
    "asked",
    [np.full(7, 12.0), np.full(7, 14.0), [14.0, *[13.0] * 6], [13.9, *[11.88] * 6]],
    ids=["12", "14", "peak", "18.2 when raw"],
)
def test_no_top_passes_the_limit_and_that_is_said(skin, asked, caplog):
    highest = 0.0
    with caplog.at_level(logging.WARNING, "bubbleskin"):
        skin.show(asked, wait=False)
    for _ in range(100):
        skin.sleep(0.02)
        highest = max(highest, skin.simulated.height_mm.max())
    assert highest <= skin.info.height_max_mm
    (said,) = caplog.messages
    assert "cannot have the heights asked" in said
    state = skin.state()
    assert np.ptp(state.height_mm[1:]) < 0.1, "asked alike, shown alike"
    assert not state.settled
    assert state.arrived
    assert state.target_mm == pytest.approx(np.asarray(asked))


@pytest.mark.promise("height-neighbours")
@pytest.mark.slow
def test_no_random_show_of_a_calibrated_wristband_passes_the_limit():
    """Of sheets and springs that differ, ideal and real rubber: heights that mostly cannot be had, one after the other."""
    highest = [row.value for row in touching.rows(0.4, seed=101) if "random shows: highest top" in row.name]
    assert len(highest) == 2
    assert max(highest) <= 14.0 + HELD_MM


def test_apart_the_bytes_are_those_of_raw_heights():
    shapes = [[6.0, 7, 8, 9, 9.5, 9, 8], [5.5] * 7, [9.8] * 7]
    sent = []
    for plan in (True, False):
        with bs.connect(CROWDED) as skin:
            write, frames = skin.link.transport.write, []
            skin.link.transport.write = lambda data, write=write, frames=frames: (
                frames.append(bytes(data)),
                write(data),
            )
            for shape in shapes:
                skin.show(shape, plan=plan)
            sent.append(frames)
    assert sent[0] == sent[1]


def test_without_contact_nothing_is_made_up_for():
    with bs.connect(f"{CROWDED}?contact=0") as skin:
        state = skin.show(ORDERED)
        assert skin.simulated.height_mm == pytest.approx(ORDERED, abs=0.1)
        assert (state.height_mm == state.alone_mm).all()


def test_telemetry_and_recordings_have_tops(skin, tmp_path):
    skin.show(LIFTED)
    (state,) = itertools.islice(skin.telemetry(20), 1)
    assert state.height_mm[0] == pytest.approx(12.5, abs=0.15)
    assert state.alone_mm[0] < 12.0
    path = tmp_path / "tops.csv"
    skin.record(path, seconds=0.2)
    names, row = [line.split(",") for line in path.read_text().splitlines() if not line.startswith("#")][:2]
    said = dict(zip(names, row, strict=True))
    assert float(said["height_mm_0"]) == pytest.approx(12.5, abs=0.15)
    assert float(said["alone_mm_0"]) < 12.0
    assert float(said["sd_mm_0"]) > 0


def test_a_stream_follows_a_pointer(skin):
    """A hill under a pointer that moves 30 times a second, so steep that its flanks lift it."""
    x, y = skin.layout.positions_mm.T
    skin.show([6.0] * 7)
    errors = []
    for frame in range(90):
        at = 8 * np.cos(frame / 15), 8 * np.sin(frame / 10)
        hill = 6 + 6 * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * 8**2))
        skin.show(hill, over=1 / 30, wait=False)
        skin.sleep(1 / 30)
        if frame > 15:
            errors.append(skin.simulated.height_mm - hill)
    assert np.sqrt(np.mean(np.square(errors))) < 0.25


def test_who_comes_to_an_inflated_wristband_is_not_told_what_nobody_knows(skin):
    skin.show(ORDERED, wait=False)
    skin.sleep(3.0)
    from bubbleskin.async_skin import AsyncSkin
    from bubbleskin.link.link import run_sync

    other = bs.Skin(run_sync(AsyncSkin.open(skin.link.transport, 2.0, simulated=skin.simulated)))
    state = other.state()
    assert np.isnan(state.sd_mm).all()
    assert set(state.status) == {"unsure"}
    assert state.alone_mm == pytest.approx(skin.simulated.alone_mm, abs=0.1)
    shown = other.show(LIFTED)
    assert np.isfinite(shown.sd_mm).all()
    assert skin.simulated.height_mm == pytest.approx(LIFTED, abs=0.2)


def lowest(skin, asked, seconds=2.0):
    """The lowest that each bubble truly was alone while this was shown, mm."""
    skin.show(asked, wait=False)
    low = skin.simulated.alone_mm
    for _ in range(round(seconds / 0.05)):
        skin.sleep(0.05)
        low = np.minimum(low, skin.simulated.alone_mm)
    return low


def test_bubbles_that_were_pressed_for_long_go_flat_before_the_next_shape_that_touches(skin, caplog):
    """A device takes a neighbour's push for the pressure of its rubber, and knows a bubble again that has been flat."""
    other = np.array([11.0, 10.4, 10.4, 8.0, 5.5, 5.5, 5.5])
    skin.show([10.4, 10.8, 5.5, 5.5, 5.5, 5.5, 5.5])
    assert lowest(skin, other)[:2].min() > 10.0
    skin.sleep(4.0)
    with caplog.at_level(logging.INFO, "bubbleskin"):
        low = lowest(skin, other - 0.2)
    assert low[:3].max() < skin.info.height_rest_mm + 0.1
    assert low[4:].min() > 5.2
    assert skin.simulated.height_mm == pytest.approx(other - 0.2, abs=0.15)
    assert caplog.messages == ["Neighbours have pressed bubbles 0, 1 and 2 for long: flat first, to be measured anew."]
    assert lowest(skin, other)[:3].min() > 10.0


@pytest.mark.slow
def test_on_real_rubber_pressed_bubbles_are_known_only_because_they_go_flat():
    """Ten shapes that touch, of 3 s each: sizes told against true ones, planned and raw, which never goes flat."""
    off = {}
    for plan in (True, False):
        off[plan] = []
        for seed in (1, 2):
            rng = np.random.default_rng(seed)
            with bs.connect(f"{CROWDED}?rubber=real") as skin:
                for _ in range(10):
                    skin.show(rng.uniform(7.0, 13.0, 7), over=0.4, wait=False, plan=plan)
                    skin.sleep(3.0)
                    off[plan].append(skin.state().alone_mm - skin.simulated.alone_mm)
    planned, raw = np.array(off[True]), np.array(off[False])
    assert np.sqrt(np.mean(planned**2)) < 0.15
    assert np.sqrt(np.mean(raw**2)) > 0.2
    assert np.abs(raw).max() > 1.0


def test_bubbles_apart_never_go_flat_first(skin):
    for height in (9.0, 9.4):
        skin.show([height] * 7)
        skin.sleep(6.0)
    assert lowest(skin, [9.0] * 7).min() > 8.8


def test_vent_forgets_who_lifted_whom(skin):
    skin.show(LIFTED)
    skin.vent()
    skin.sleep(2.0)
    state = skin.state()
    assert (state.height_mm == state.alone_mm).all()
    assert set(state.status) == {"resting"}


@pytest.mark.parametrize("plan", [None, 1, "yes", np.True_])
def test_plan_is_a_flag(skin, plan):
    if isinstance(plan, np.bool_):
        skin.show([6.0] * 7, plan=plan)
        return
    with pytest.raises(bs.InvalidInput, match=r"plan is .*; give True or False"):
        skin.show([6.0] * 7, plan=plan)


@pytest.mark.parametrize("name", ["pulse", "breathing"])
def test_a_sequence_of_the_library_stays_below_the_limit(skin, name, caplog):
    with caplog.at_level(logging.WARNING, "bubbleskin"):
        skin.play(name, wait=False)
    assert caplog.messages[0].startswith(
        f"The sequence {name} would let neighbours lift a bubble past the limit of 14 mm"
    )
    highest = 0.0
    for _ in range(300):
        skin.sleep(0.02)
        highest = max(highest, skin.simulated.height_mm.max())
    assert 10.0 < highest <= skin.info.height_max_mm


def test_a_sequence_of_bubbles_apart_is_played_as_it_is(skin, caplog):
    sequence = bs.sequences.pulse(skin.layout, high_mm=9.5, loops=1)
    skin.play(sequence)
    assert caplog.messages == []
    assert skin.state().target_mm == pytest.approx([5.5, *[9.5] * 6])


def test_a_raw_sequence_is_not_cut(skin, caplog):
    skin.play(bs.Sequence([bs.Step([12.0] * 7, 0.5)]), anyway=True)
    assert caplog.messages == []
    assert skin.state().target_mm == pytest.approx(12.0)
