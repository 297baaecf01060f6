"""Sequences on the host: what they mean, their files, and what is refused."""

import itertools
import json
import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

import bubbleskin as bs
from bubbleskin.sequence.files import SCHEMA
from bubbleskin.sequence.steps import EASINGS, STEPS_MAX, THEN

N = 3
SCHEMA_DATA = json.loads(SCHEMA.read_text(encoding="utf-8"))

milliseconds = st.integers(0, 60000).map(lambda ms: ms / 1000)
targets = st.none() | st.lists(st.none() | st.integers(0, 14000).map(lambda um: um / 1000), min_size=N, max_size=N)
conditions = st.builds(bs.After, milliseconds) | st.builds(
    bs.Settled, st.integers(50, 5000).map(lambda um: um / 1000), milliseconds, st.sampled_from(THEN)
)
single = st.builds(
    bs.Step,
    targets,
    st.integers(5, 60000).map(lambda ms: ms / 1000),
    st.sampled_from(EASINGS),
    conditions,
    st.text(max_size=4),
)
parts = st.recursive(
    single, lambda inner: st.builds(bs.Repeat, st.lists(inner, min_size=1, max_size=3), st.integers(0, 3)), max_leaves=6
)
layouts = st.none() | st.sampled_from([bs.Layout.grid(1, N), bs.Layout.grid(N, 1, 7.5)])


@st.composite
def sequences(draw):
    steps = [bs.Step([6.0] * N, 0.1), *draw(st.lists(parts, max_size=4))]
    try:
        return bs.Sequence(
            steps,
            loops=draw(st.integers(0, 3)),
            name=draw(st.text(max_size=5)),
            board=draw(st.none() | st.just("wristband7")),
            layout=draw(layouts),
        )
    except bs.InvalidInput:  # nested too deep
        return bs.Sequence(steps[:1])


@pytest.mark.slow
@settings(max_examples=25)
@given(sequences())
def test_json_comes_back_as_it_was_and_is_by_the_schema(sequence):
    import jsonschema  # takes a second, which whoever collects tests would wait for

    text = sequence.to_json()
    assert bs.Sequence.from_json(text) == sequence
    jsonschema.validate(json.loads(text), SCHEMA_DATA)


@pytest.mark.medium
@settings(max_examples=40)
@given(sequences())
def test_duration_is_the_sum_of_what_is_played(sequence):
    order = list(itertools.islice(sequence.unrolled(), 300))
    if len(order) < 300:
        assert sequence.duration == pytest.approx(sum(sequence.each[i].shortest for i in order), abs=1e-6)
        assert sequence.longest == pytest.approx(sum(sequence.each[i].longest for i in order), abs=1e-6)
        assert sequence.duration <= sequence.longest + 1e-9 or any(step.longest < 0.005 for step in sequence.each)
    assert math.isinf(sequence.duration) == (sequence.loops == 0 or any(r.times == 0 for r in repeats(sequence.steps)))


def repeats(steps):
    for part in steps:
        if isinstance(part, bs.Repeat):
            yield part
            yield from repeats(part.steps)


@pytest.mark.medium
def test_the_schema_is_one():
    import jsonschema

    jsonschema.Draft202012Validator.check_schema(SCHEMA_DATA)


@pytest.mark.medium
def test_the_schemas_defaults_are_the_readers():
    import jsonschema

    text = '{"bubbleskin_sequence": 1, "steps": [{"targets_mm": [6, null], "until": {"settled_mm": 0.2}}]}'
    jsonschema.validate(json.loads(text), SCHEMA_DATA)
    assert bs.Sequence.from_json(text) == bs.Sequence([bs.Step([6.0, None], until=bs.Settled())])


STEP = {"targets_mm": [6.0, 7.0], "ramp_s": 1.0}
BAD_JSON = {
    "no JSON": ("{", "is not JSON"),
    "another version": ({"bubbleskin_sequence": 2, "steps": [STEP]}, "is 2; this SDK reads 1"),
    "no version": ({"steps": [STEP]}, "is None; this SDK reads 1"),
    "no steps": ({"bubbleskin_sequence": 1}, "steps is None"),
    "empty": ({"bubbleskin_sequence": 1, "steps": []}, "without steps"),
    "an empty repeat": (
        {"bubbleskin_sequence": 1, "steps": [STEP, {"repeat": 2, "steps": []}]},
        "repeat without steps",
    ),
    "a jump": (
        {"bubbleskin_sequence": 1, "steps": [{**STEP, "goto": 0}]},
        r"steps\[0\] has 'goto', which means nothing",
    ),
    "a reference": ({"bubbleskin_sequence": 1, "steps": [{"$ref": "#/steps"}]}, r"steps\[0\] has '\$ref'"),
    "no targets": ({"bubbleskin_sequence": 1, "steps": [{"ramp_s": 1}]}, r"steps\[0\] has no targets_mm"),
    "a step that is a list": (
        {"bubbleskin_sequence": 1, "steps": [[6, 7]]},
        r"steps\[0\] is \[6, 7\]; it must be an object",
    ),
    "a word": (
        {"bubbleskin_sequence": 1, "steps": [{"targets_mm": ["high", 6]}]},
        "bubble 0 must be a number .* not texts: 'high'",
    ),
    "true": ({"bubbleskin_sequence": 1, "steps": [{"targets_mm": [True, 6]}]}, "must be a number .*: True"),
    "negative": ({"bubbleskin_sequence": 1, "steps": [{"targets_mm": [6, -1]}]}, "bubble 1 is -1 mm"),
    "a long ramp": ({"bubbleskin_sequence": 1, "steps": [{**STEP, "ramp_s": 61}]}, "The ramp is 61 s; 0 to 60 s"),
    "an easing": (
        {"bubbleskin_sequence": 1, "steps": [{**STEP, "easing": "bouncy"}]},
        "'bouncy', but must be one of 'linear'",
    ),
    "a then": (
        {"bubbleskin_sequence": 1, "steps": [{**STEP, "until": {"then": "explode"}}]},
        "'explode', but must be one of 'go on'",
    ),
    "a tolerance": (
        {"bubbleskin_sequence": 1, "steps": [{**STEP, "until": {"settled_mm": 0}}]},
        "tolerance is 0 mm; 0.05 to 5",
    ),
    "both conditions": (
        {"bubbleskin_sequence": 1, "steps": [{**STEP, "until": {"after_s": 1, "then": "vent"}}]},
        r"steps\[0\].until has 'then'",
    ),
    "no time": ({"bubbleskin_sequence": 1, "steps": [{"targets_mm": None}]}, "only waits"),
    "counts": (
        {"bubbleskin_sequence": 1, "steps": [STEP, {"targets_mm": [6], "ramp_s": 1}]},
        "2 targets; the sequence is for 1 bubbles",
    ),
    "no heights at all": (
        {"bubbleskin_sequence": 1, "steps": [{"targets_mm": None, "ramp_s": 1}]},
        "No step .* has targets",
    ),
    "times": ({"bubbleskin_sequence": 1, "steps": [{"repeat": -1, "steps": [STEP]}]}, "plays -1 times"),
    "loops": ({"bubbleskin_sequence": 1, "steps": [STEP], "loops": 2.5}, "plays 2.5 times"),
    "a layout": (
        {"bubbleskin_sequence": 1, "steps": [STEP], "layout": {"positions_mm": "here", "pitch_mm": 1}},
        "layout is not",
    ),
}


@pytest.mark.parametrize("bad", BAD_JSON)
def test_a_bad_file_is_refused_with_a_sentence(bad, tmp_path):
    data, sentence = BAD_JSON[bad]
    text = data if isinstance(data, str) else json.dumps(data)
    with pytest.raises(bs.InvalidInput, match=sentence) as refusal:
        bs.Sequence.from_json(text)
    assert str(refusal.value).startswith("The text is not")
    assert "\n" not in str(refusal.value)
    path = tmp_path / "bad.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(bs.InvalidInput, match=r"bad\.json is not"):
        bs.Sequence.load(path)


@pytest.mark.parametrize("depth", [5, 40, 3000, 200000])
def test_repeats_beyond_any_depth_are_refused(depth):
    text = json.dumps(STEP)
    text = '{"repeat": 2, "steps": [' * depth + text + "]}" * depth
    with pytest.raises(bs.InvalidInput, match=r"deep|is not JSON"):
        bs.Sequence.from_json(f'{{"bubbleskin_sequence": 1, "steps": [{text}]}}')


def test_a_sequence_that_contains_itself_is_refused():
    inner = bs.Repeat([bs.Step([6.0], 1)], 2)
    object.__setattr__(inner, "steps", (inner,))
    with pytest.raises(bs.InvalidInput, match="contain themselves"):
        bs.Sequence([bs.Step([6.0], 1), inner])


def test_too_many_steps_in_repeats_are_refused():
    step = bs.Step([6.0], 1)
    half = bs.Repeat([step] * (STEPS_MAX // 2 + 1), 2)
    with pytest.raises(bs.InvalidInput, match=r"65536 steps; a sequence has at most 65535\. Use repeats"):
        bs.Sequence([half, half])
    assert bs.Sequence([step] * 100).longest == 100


@pytest.mark.medium
def test_1e5_steps_are_refused():
    with pytest.raises(bs.InvalidInput, match="100000 steps; a sequence has at most 65535"):
        bs.Sequence([bs.Step([6.0], 1)] * 100000)
    many = json.dumps({"bubbleskin_sequence": 1, "steps": [{"targets_mm": [6]}] * 100000})
    with pytest.raises(bs.InvalidInput, match="100000 steps; a sequence has at most 65535"):
        bs.Sequence.from_json(many)


def test_four_repeats_deep_is_allowed_with_loops_as_one():
    part = bs.Step([6.0], 0.1)
    for _ in range(4):
        part = bs.Repeat([part], 2)
    assert bs.Sequence([part]).duration == pytest.approx(1.6)
    with pytest.raises(bs.InvalidInput, match="loops included"):
        bs.Sequence([part], loops=2)


@pytest.mark.parametrize("bad", [None, 7, "steps", [7], {"a": 1}, [bs.After(1)]])
def test_what_are_no_steps_is_refused(bad):
    with pytest.raises(bs.InvalidInput, match="Steps are a list of Step and Repeat"):
        bs.Sequence(bad)


@pytest.mark.parametrize("bad", [7, "high", [math.nan], [math.inf], [70.0]])
def test_what_are_no_targets_is_refused(bad):
    with pytest.raises(bs.InvalidInput, match=r"Targets are|target of bubble 0"):
        bs.Step(bad, 1)


# Heights over time.


def test_targets_at_a_moment():
    sequence = bs.Sequence(
        [
            bs.Step([12.0, 0.0], 1.0, until=bs.After(1.0)),
            bs.Step([None, 9.0], 1.0, "smooth"),
            bs.Step([6.0, None], 0.0, until=bs.After(0.5)),
        ]
    )
    moments = {-1: (5, 5), 0: (5, 5), 0.5: (8.5, 5), 1: (12, 5), 2: (12, 5), 2.25: (12, 5 + 4 * 0.15625), 2.5: (12, 7)}
    moments |= {2.999: (12, 9), 3: (6, 9), 3.4: (6, 9), 99: (6, 9)}
    for moment, heights in moments.items():
        assert sequence.targets_at(moment) == pytest.approx(heights, abs=1e-3), moment
    assert sequence.targets_at(list(moments)) == pytest.approx(np.array(list(moments.values())), abs=1e-3)
    shuffled = [3.4, -1, 2.5, 0.5]
    assert sequence.targets_at(shuffled) == pytest.approx(np.array([moments[t] for t in shuffled]))


def test_targets_go_round_with_the_loops():
    sequence = bs.Sequence([bs.Step([10.0], 1.0), bs.Step([6.0], 1.0)], loops=0)
    assert sequence.targets_at(1000.5) == pytest.approx([8.0])
    assert sequence.targets_at(0.5) == pytest.approx([7.5]), "the first time from rest"
    only_waits = bs.Sequence([bs.Step([10.0], until=bs.Settled())], loops=0)
    assert only_waits.targets_at(3.0) == pytest.approx([10.0])
    with pytest.raises(bs.InvalidInput, match="finite"):
        sequence.targets_at(math.inf)


# Timelines.


def write(tmp_path, text):
    path = tmp_path / "line.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_timeline_is_followed(tmp_path):
    path = write(tmp_path, "time_s,b0,b1\n0,6,7\n0.3333,8,7\n0.6667,,9\n1,6,9.5\n")
    sequence = bs.Sequence.from_csv(path, loops=2)
    assert [step.targets_mm for step in sequence.each] == [(6, 7), (8, 7), (None, 9), (6, 9.5)]
    assert [step.ramp for step in sequence.each] == [0.5, 0.333, 0.334, 0.333]
    assert sequence.duration == pytest.approx(3.0)
    assert bs.Sequence.load(path).loops == 1
    begins_later = bs.Sequence.from_csv(write(tmp_path, "time_s,b0\n2,6\n2.5,8\n"))
    assert [step.ramp for step in begins_later.each] == [2.0, 0.5]


def test_times_of_a_long_timeline_do_not_drift(tmp_path):
    rows = "".join(f"{k / 30:.6f},{6 + k % 5}\n" for k in range(3001))
    sequence = bs.Sequence.from_csv(write(tmp_path, "time_s,b0\n" + rows))
    assert sequence.duration == pytest.approx(0.5 + 100.0, abs=1e-9)


BAD_CSV = {
    "no header": ("0,6\n1,7\n", "begins with the columns 0,6; a timeline has time_s,b0"),
    "columns that miss one": ("time_s,b0,b2\n0,6,7\n", "has no column b1"),
    "columns that count from one": ("time_s,b1,b2\n0,6,7\n", "bubbles count from 0: name them b0 to b1"),
    "a column twice": ("time_s,b0,b0\n0,6,7\n", "has no column b1"),
    "no bubbles": ("time_s\n0\n", "begins with the columns"),
    "nothing": ("", "begins with the columns"),
    "only a header": ("time_s,b0\n", "no rows"),
    "a word": ("time_s,b0\n0,high\n", "line 2, column b0: it is 'high', not a number"),
    "a missing cell": ("time_s,b0,b1\n0,6\n", "line 2 has 2 cells under 3 headings"),
    "no time": ("time_s,b0\n,6\n", "line 2 has no time"),
    "time that stands": ("time_s,b0\n0,6\n1,7\n1,8\n", "line 4 is at 1 s, not after"),
    "time that runs back": ("time_s,b0\n1,6\n0.5,7\n", "line 3 is at 0.5 s"),
    "a gap": ("time_s,b0\n1,6\n100,7\n", "line 3: The ramp is 99 s"),
    "a height": ("time_s,b0\n1,-6\n", "line 2: The target of bubble 0 is -6 mm"),
    "infinity": ("time_s,b0\n1,inf\n", "line 2, column b0: it is inf, not a number"),
}


@pytest.mark.parametrize("bad", BAD_CSV)
def test_a_bad_timeline_is_refused_with_its_line(bad, tmp_path):
    text, sentence = BAD_CSV[bad]
    with pytest.raises(bs.InvalidInput, match=sentence):
        bs.Sequence.load(write(tmp_path, text))
