"""The sequence that is edited: no change loses anything, and each can be undone. No page, no wristband."""

import hypothesis.strategies as st
import pytest
from hypothesis import assume, given, settings

import bubbleskin as bs
from bubbleskin.sequence.library import LIBRARY
from bubbleskin.sequence.steps import EASINGS, THEN, each_step
from bubbleskin.studio import edits
from bubbleskin.studio.timeline import STEPS_MAX, Chosen, Timeline

N = 3
LAYOUT = bs.Layout.grid(1, N)
milliseconds = st.integers(0, 60000).map(lambda ms: ms / 1000)
heights = st.integers(0, 14000).map(lambda um: um / 1000)
targets = st.none() | st.lists(st.none() | heights, min_size=N, max_size=N)
conditions = st.builds(bs.After, milliseconds) | st.builds(
    bs.Settled, st.integers(50, 5000).map(lambda um: um / 1000), milliseconds, st.sampled_from(THEN)
)
ramps = st.integers(5, 60000).map(lambda ms: ms / 1000)
single = st.builds(bs.Step, targets, ramps, st.sampled_from(EASINGS), conditions, st.text(max_size=3))
parts = st.recursive(
    single, lambda inner: st.builds(bs.Repeat, st.lists(inner, min_size=1, max_size=3), st.integers(0, 3)), max_leaves=5
)


@st.composite
def sequences(draw):
    steps = [bs.Step([6.0] * N, 0.1), *draw(st.lists(parts, max_size=4))]
    layout = draw(st.none() | st.just(LAYOUT))
    try:
        return bs.Sequence(
            steps, loops=draw(st.integers(0, 3)), name=draw(st.text(max_size=3)), board="wristband7", layout=layout
        )
    except bs.InvalidInput:  # nested too deep
        return bs.Sequence(steps[:1])


@st.composite
def changes(draw, steps):
    """What a page can ask for, sound or not."""
    step, last = draw(st.integers(0, steps - 1)), draw(st.integers(0, steps - 1))
    row, time, height = draw(st.integers(-1, N)), draw(st.integers(0, 200_000)), draw(st.none() | heights)
    until = draw(
        st.builds(lambda s: {"after": s}, milliseconds)
        | st.builds(
            lambda s, then: {"tolerance_mm": 0.5, "timeout_s": s, "then": then}, milliseconds, st.sampled_from(THEN)
        )
    )
    return draw(
        st.sampled_from(
            [
                {"kind": "place", "step": step, "row": row, "time": time, "height": height},
                {"kind": "place", "step": step, "time": time},
                {"kind": "add", "row": row, "time": time, "height": height},
                {"kind": "delete", "step": step, "last": last, "row": row},
                {"kind": "step", "step": step, "ramp": draw(ramps), "easing": "in", "name": "new"},
                {"kind": "step", "step": step, "until": until},
                {"kind": "repeat", "step": step, "last": last, "times": draw(st.integers(0, 4))},
                {
                    "kind": "times",
                    "path": draw(st.lists(st.integers(0, 3), max_size=3)),
                    "times": draw(st.integers(0, 4)),
                },
                {"kind": "whole", "loops": draw(st.integers(0, 4)), "name": "dance"},
                {"kind": "rows", "rows": draw(st.sampled_from(["bubbles", "rings", "all", "none"]))},
                {"kind": "place"},
                {"kind": "place", "step": "a", "time": None},
                {},
            ]
        )
    )


def state_of(timeline):
    return timeline.sequence.to_json(), timeline.can_undo, timeline.can_redo


@pytest.mark.medium
@settings(max_examples=30)
@given(sequences(), st.data())
def test_any_change_undone_is_as_it_was_and_done_again_as_it_became(sequence, data):
    timeline = Timeline(sequence)
    seen = [sequence.to_json()]
    for _ in range(4):
        before = state_of(timeline)
        try:
            timeline.change(data.draw(changes(len(timeline.sequence.each))), LAYOUT)
        except bs.InvalidInput:
            assert state_of(timeline) == before
        if timeline.sequence.to_json() != seen[-1]:
            seen.append(timeline.sequence.to_json())
        assert bs.Sequence.from_json(seen[-1]) == timeline.sequence  # whatever it has become can be saved
        step, last, _ = timeline.chosen
        assert step < len(timeline.sequence.each) > last
    for earlier in seen[-2::-1]:
        timeline.undo()
        assert timeline.sequence.to_json() == earlier
    assert not timeline.can_undo
    for later in seen[1:]:
        timeline.redo()
        assert timeline.sequence.to_json() == later


@settings(max_examples=25)
@given(sequences())
def test_what_is_opened_is_saved_as_it_was(sequence):
    timeline = Timeline(LIBRARY["pulse"](bs.Layout.hexagon()))
    timeline.become(bs.Sequence.from_json(sequence.to_json()))
    assert timeline.sequence.to_json() == sequence.to_json()


@pytest.mark.parametrize("name", LIBRARY)
@pytest.mark.parametrize("rings", [1, 2])
def test_every_sequence_of_the_library_is_saved_as_it_was(name, rings):
    text = LIBRARY[name](bs.Layout.hexagon(rings=rings)).to_json()
    assert Timeline(bs.Sequence.from_json(text)).sequence.to_json() == text


@settings(max_examples=30)
@given(sequences(), st.data())
def test_a_keyframe_stands_where_it_is_put_and_no_other_moves(sequence, data):
    index = data.draw(st.integers(0, len(sequence.each) - 1))
    before = edits.moments(sequence)
    at = data.draw(st.integers(0, before[-1].end))
    after_it = edits.moments(edits.moved(sequence, index, at))
    assert after_it[index].begin == before[index].begin <= after_it[index].arrival
    shift = after_it[-1].end - before[-1].end
    for number, (one, other) in enumerate(zip(before, after_it, strict=True)):
        if number > index:
            assert other.end - one.end in (0, shift)
            assert edits.is_wait(sequence.each[number]) or other.arrival - one.arrival in (0, shift)
    if (
        before[index].begin + 10 <= at < min(before[index].end, before[index].begin + 60_000)
    ):  # in its own step there is room
        assert after_it[index].arrival == at


@settings(max_examples=30)
@given(sequences(), st.data())
def test_a_new_keyframe_is_where_it_was_asked_and_changes_no_other_row(sequence, data):
    before = edits.moments(sequence)
    at = data.draw(st.integers(1, min(before[-1].end, 10**6)))
    assume(all(step.ramp > 0.02 for step in sequence.each))
    with_one, step = edits.keyed(sequence, at, [1], 9.0)
    assert with_one.each[step].targets_mm[1] == 9.0
    assert abs(edits.moments(with_one)[step].arrival - at) <= 5
    assert edits.heights_at(with_one, edits.moments(with_one)[step].arrival)[1] == 9.0
    for bubble in (0, 2):
        for old, new in zip(
            (m.arrival for m in before),
            (edits.moments(with_one)[i].arrival for i in _kept(sequence, with_one, step)),
            strict=True,
        ):
            assert abs(edits.heights_at(sequence, old)[bubble] - edits.heights_at(with_one, new)[bubble]) < 2e-3


def _kept(sequence, with_one, step):
    """The steps of `with_one` that were there before: all but the new one."""
    more = len(with_one.each) - len(sequence.each)
    return [index for index in range(len(with_one.each)) if not more or index != step]


def test_moving_takes_from_the_wait_and_then_from_the_ramp_after_it():
    sequence = bs.Sequence([bs.Step([6.0], 1.0, until=bs.After(0.5)), bs.Step([8.0], 1.0)])
    assert [tuple(m) for m in edits.moments(edits.moved(sequence, 0, 1300))] == [(0, 1300, 1500), (1500, 2500, 2500)]
    assert [tuple(m) for m in edits.moments(edits.moved(sequence, 0, 1900))] == [(0, 1900, 1900), (1900, 2500, 2500)]
    assert [tuple(m) for m in edits.moments(edits.moved(sequence, 0, 9000))] == [(0, 2490, 2490), (2490, 2500, 2500)]
    assert [tuple(m) for m in edits.moments(edits.moved(sequence, 0, 400))] == [(0, 400, 1500), (1500, 2500, 2500)]
    assert [tuple(m) for m in edits.moments(edits.moved(sequence, 1, 4000))] == [(0, 1000, 1500), (1500, 4000, 4000)]


def test_repeats_are_made_of_whole_parts_only():
    inner = bs.Repeat([bs.Step([6.0], 1.0), bs.Step([7.0], 1.0)], 2)
    sequence = bs.Sequence([bs.Step([5.0], 1.0), inner, bs.Step([8.0], 1.0)])
    assert edits.repeated(sequence, 0, 2, 3).steps[0] == bs.Repeat([bs.Step([5.0], 1.0), inner], 3)
    assert edits.repeated(sequence, 2, 1, 3).steps[1] == bs.Repeat([bs.Repeat(inner.steps, 3)], 2)
    assert edits.repeated(sequence, 0, 3, 3).steps == (bs.Repeat(sequence.steps, 3),)
    for first, last in ((0, 1), (2, 3)):
        with pytest.raises(bs.InvalidInput, match="within a repeat"):
            edits.repeated(sequence, first, last, 3)
    assert edits.with_times(sequence, (1,), 1).steps == tuple(each_step(sequence.steps))
    assert edits.without_step(edits.without_step(sequence, 2), 1).steps == (sequence.steps[0], sequence.steps[2])


def test_what_is_too_long_or_too_high_is_refused_and_nothing_is_lost():
    timeline = Timeline(bs.Sequence([bs.Step([6.0] * N, 1.0)]), high_mm=14.0)
    with pytest.raises(bs.InvalidInput, match=f"takes {STEPS_MAX}"):
        timeline.become(bs.Sequence([bs.Step([6.0] * N, 1.0)] * (STEPS_MAX + 1)))
    with pytest.raises(bs.InvalidInput, match="14 mm"):
        timeline.change({"kind": "place", "step": 0, "row": 0, "height": 15.0}, None)
    with pytest.raises(bs.InvalidInput, match="only step"):
        timeline.change({"kind": "delete", "step": 0, "last": 0, "row": -1}, None)
    for field in ({"ramp": None}, {"until": {"after": None}}, {"until": {"timeout_s": None}}):
        with pytest.raises(bs.InvalidInput, match="is empty"):
            timeline.change({"kind": "step", "step": 0, **field}, None)
    assert state_of(timeline) == (bs.Sequence([bs.Step([6.0] * N, 1.0)]).to_json(), False, False)


def test_rows_are_bubbles_rings_or_all():
    timeline = Timeline(bs.Sequence([bs.Step([6.0] * 7, 1.0)]))
    timeline.change({"kind": "rows", "rows": "rings"}, bs.Layout.hexagon())
    timeline.change({"kind": "add", "row": 1, "time": 2000, "height": 9.0}, bs.Layout.hexagon())
    assert timeline.sequence.each[1].targets_mm == (None, *[9.0] * 6)
    assert timeline.chosen == Chosen(1, 1, 1)
    assert [row.name for row in timeline.rows(None)] == [f"Bubble {bubble}" for bubble in range(7)]
    timeline.change({"kind": "delete", "step": 1, "row": 1}, bs.Layout.hexagon())
    assert len(timeline.sequence.each) == 1
