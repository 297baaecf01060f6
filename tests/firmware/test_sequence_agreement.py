"""Host and device agree on what can be played: random sequences, sound and not, to the SDK's reader and to the firmware."""

import json
import random

import pytest

import bubbleskin as bs
from bubble_protocol import steps
from bubble_protocol.schema import errors, messages
from bubbleskin.device.info import Info
from bubbleskin.sequence.compile import Compiled, check

EASINGS = ["linear", "smooth", "in", "out"]
THEN = ["go on", "hold", "vent", "stop"]


def draw(rng, sound, low, high, *odd):
    """A number within the limits, or now and then an odd one."""
    return rng.randint(low, high) if rng.random() < sound else rng.choice(odd)


def random_step(rng, n, sound):
    step = {
        "targets_mm": [
            None if rng.random() < 0.2 else draw(rng, sound, 0, 14000, 14001, 65534) / 1000 for _ in range(n)
        ],
        "ramp_s": draw(rng, sound, 0, 60000, 60001, 65535, 0, 4) / 1000,
        "easing": rng.choice(EASINGS),
    }
    if rng.random() < 0.5:
        step["until"] = {"after_s": draw(rng, sound, 5, 60000, 0, 4, 5, 60001, 65535) / 1000}
    else:
        step["until"] = {
            "settled_mm": draw(rng, sound, 50, 5000, 0, 49, 5001, 65535) / 1000,
            "timeout_s": draw(rng, sound, 5, 60000, 0, 4, 5, 60001) / 1000,
            "then": rng.choice(THEN),
        }
    return step


def random_steps(rng, n, sound, depth=0):
    parts = []
    for _ in range(rng.randint(0 if rng.random() > sound else 1, 3)):
        if depth < 6 and rng.random() < 0.35:
            times = rng.choice([0, 1, 2, 65535])
            parts.append({"repeat": times, "steps": random_steps(rng, n, sound, depth + 1)})
        else:
            parts.append(random_step(rng, n, sound))
    return parts


def encode(parts, loops, n):
    """The records, written after docs/protocol.md and not with the SDK's code."""
    blank = [0] * (2 + n)
    records = []
    for part in parts:
        if "repeat" in part:
            records += [[1, part["repeat"], *blank], *encode(part["steps"], 1, n), [2, 0, *blank]]
            continue
        until = part["until"]
        settle = "settled_mm" in until
        flags = EASINGS.index(part["easing"]) << 2 | settle << 4 | (THEN.index(until["then"]) << 5 if settle else 0)
        wait = until["timeout_s"] if settle else until["after_s"]
        tolerance = until["settled_mm"] if settle else 0
        targets = [0xFFFF if mm is None else round(mm * 1000) for mm in part["targets_mm"]]
        records.append([flags, round(part["ramp_s"] * 1000), round(wait * 1000), round(tolerance * 1000), *targets])
    return records if loops == 1 else [[1, loops, *blank], *records, [2, 0, *blank]]


def info_of(rig):
    return Info.of(rig.open(rig.session))


def the_host_takes(data, info, layout):
    try:
        sequence = bs.Sequence.from_json(json.dumps(data))
        check(sequence, info, layout)
    except bs.InvalidInput:
        return None
    return sequence


def the_device_takes(sequencer, records):
    sequencer.id += 1
    if not records:
        return False
    try:
        sequencer.upload(records)
    except AssertionError:
        return False
    return sequencer.ask("SEQUENCE_ARM", sequencer.id).id != messages.ERROR


@pytest.mark.parametrize("seed", range(3))
def test_host_and_device_agree(seven, seed):
    rng = random.Random(seed)
    info, layout = info_of(seven.rig), bs.Layout.hexagon()
    verdicts = []
    for _ in range(150):
        sound = rng.choice([1.0, 0.995, 0.95])
        parts = random_steps(rng, 7, sound)
        loops = rng.choice([0, 1, 1, 3])
        sequence = the_host_takes({"bubbleskin_sequence": 1, "steps": parts, "loops": loops}, info, layout)
        taken = the_device_takes(seven, encode(parts, loops, 7))
        assert taken == (sequence is not None), (loops, parts)
        verdicts.append(taken)
    assert 30 < sum(verdicts) < 120, "both kinds were tried"
    assert seven.rig.app.stats.exceptions == 0


def test_the_sdks_records_are_those_of_the_protocols_page(seven):
    rng = random.Random(9)
    info, layout = info_of(seven.rig), bs.Layout.hexagon()
    compared = 0
    while compared < 30:
        parts = random_steps(rng, 7, 1.0)
        sequence = the_host_takes({"bubbleskin_sequence": 1, "steps": parts, "loops": 2}, info, layout)
        if sequence is None or '"repeat": 1,' in sequence.to_json():
            continue
        compared += 1
        assert Compiled.of(sequence, info, layout).records.tolist() == encode(parts, 2, 7)


@pytest.mark.medium
def test_random_words_never_harm(seven):
    """Whatever passes the frame's CRC: bad records are refused, good ones are within the limits, nothing fails."""
    rng = random.Random(3)
    taken = 0
    for _ in range(600):
        seven.begin(rng.choice([0, 1, 2, 5, 5000]), crc=rng.getrandbits(32))
        count = rng.randint(1, 4)
        words = [rng.choice((0, 1, 2, 5, 16, 100, 300, 8000, 14000, 14001, 65535)) for _ in range(11 * count)]
        if rng.random() < 0.5:
            for at in range(0, len(words), 11):
                words[at] = rng.choice((0, 4, 8))
                words[at + 3] = 0
                words[at + 4 : at + 11] = [min(word, 14000) for word in words[at + 4 : at + 11]]
        answer = seven.ask("SEQUENCE_WRITE", 7, 0, repeated=[(word,) for word in words])
        if answer.id != messages.ERROR:
            taken += 1
            for at in range(0, len(words), 11):
                if words[at] & 3 == steps.STEP:
                    assert all(word <= 14000 or word == 65535 for word in words[at + 4 : at + 11])
        else:
            assert answer["error"] in (errors.BAD_STEP, errors.BAD_LOOP, errors.NO_ROOM)
        seven.ask("SEQUENCE_ARM", 7)
        seven.ask("SEQUENCE_START", 7, 0)
        seven.tick(rng.randrange(3))
    assert taken > 20
    assert seven.rig.app.stats.exceptions == 0
