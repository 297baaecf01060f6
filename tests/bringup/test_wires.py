"""From pulses to names: every wiring of one or two mistakes is told from what an ideal board would show of it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bubbleskin.bringup import wires
from bubbleskin.bringup.evidence import FELL, HELD, NONE, OPEN, ROSE, Pulse
from bubbleskin.bringup.findings import MEANINGS, Finding
from bubbleskin.sim.wiring import Wiring, valve_names

N = 7


class IdealBoard:
    """What `n` bubbles wired as `wiring` says would show, written for itself; the vents of `stuck` never open."""

    def __init__(self, wiring: Wiring, n: int = 7, stuck: tuple[int, ...] = ()):
        self.n, self.stuck = n, stuck
        names = valve_names(n)
        plugs = dict(zip(names, names, strict=True))
        for one, other in wiring.valves:
            plugs[one], plugs[other] = plugs[other], plugs[one]
        tube = {i: i for i in range(n)}
        for one, other in wiring.tubes:
            tube[one], tube[other] = tube[other], tube[one]
        wire = {i: i for i in range(n)}
        for one, other in wiring.sensors:
            wire[one], wire[other] = wire[other], wire[one]
        self._tube = tube
        self._valve = {name: place for name, place in plugs.items() if place not in wiring.dead}
        self._channel_of = {place: channel for channel, place in wire.items()}

    def pulse(self, asked: tuple[int, ...], off: int | None, heard: bool | None = None) -> Pulse:
        """SHOW of `asked`, with bubble `off` pulled."""
        filled, shut, always = set(), set(), set()
        for bubble in asked:
            fill, vent = self._valve.get(f"fill{bubble}", ""), self._valve.get(f"vent{bubble}", "")
            if fill.startswith("fill"):
                filled.add(int(fill[4:]))
            if vent.startswith("vent"):
                shut.add(int(vent[4:]))
            elif vent.startswith("fill"):  # has current for as long as the vent should be shut
                always.add(int(vent[4:]))
        seen, rise, left = [NONE] * self.n, [0.0] * self.n, [0.0] * self.n
        for place in filled | always:
            channel = self._channel_of[place]
            is_off = self._tube[place] == off
            rise[channel] = 3.4 if is_off else 6.0
            if place in always:
                seen[channel] = HELD if is_off else ROSE
            elif is_off:
                seen[channel] = OPEN
            else:
                seen[channel] = HELD if place in shut or place in self.stuck else FELL
                left[channel] = 6.0 if place in self.stuck else 0.0
        return Pulse(asked, off, tuple(seen), tuple(rise), tuple(left), heard)


def diagnose(wiring: Wiring, stuck: tuple[int, ...] = (), heard: bool | None = None) -> list[Finding]:
    """What is said of a board after all the pulses that a bring-up gives."""
    board, pulses, bubbles = IdealBoard(wiring, N, stuck), wires.Pulses(), range(N)
    for bubble in bubbles:
        pulses.add(board.pulse((bubble,), bubble, heard))
    for bubble in bubbles:
        pulses.add(board.pulse((bubble,), None))
    given_so_far = 2 * N
    while more := wires.further(pulses, bubbles):
        pulses.add(board.pulse(*more[0]))
        given_so_far += 1
        assert given_so_far < 2 * N + 40, "it comes to an end"
    findings = wires.diagnose(pulses, bubbles)
    assert {finding.name for finding in findings} <= MEANINGS.keys()
    return findings


def names(findings: list[Finding]) -> list[str]:
    return sorted(finding.name for finding in findings)


KINDS = {
    "tubes_swapped": "tubes",
    "sensor_wires_swapped": "sensors",
    "fill_valves_swapped": "valves",
    "vent_valves_swapped": "valves",
    "fill_and_vent_swapped": "valves",
}


def told(findings: list[Finding]) -> Wiring:
    """The wiring that the findings say: two parts of a swap each."""
    said: dict[str, list] = {"tubes": [], "sensors": [], "valves": []}
    dead = []
    for finding in findings:
        numbers = [int(part.split()[-1]) for part in finding.parts]
        if finding.name in KINDS:
            kind = KINDS[finding.name]
            parts = [f"{part.split()[0]}{part.split()[-1]}" for part in finding.parts] if kind == "valves" else numbers
            assert len(parts) == 2, finding
            said[kind].append(tuple(parts))
        elif finding.name in ("fill_valve_dead", "vent_valve_dead"):
            dead.append(f"{finding.parts[0].split()[0]}{numbers[0]}")
        else:
            raise AssertionError(finding)
    return Wiring(tuple(said["tubes"]), tuple(said["valves"]), tuple(said["sensors"]), tuple(dead))


def alike(one: Wiring, other: Wiring) -> bool:
    """Whether a board behaves the same, wired one way or the other."""
    return (one.coils(N) == other.coils(N)).all() and (one.channels(N) == other.channels(N)).all()


def test_a_board_that_is_wired_as_it_should_be_has_nothing_to_mend():
    assert diagnose(Wiring()) == []


bubbles = st.integers(0, N - 1)
two = st.tuples(bubbles, bubbles).filter(lambda pair: pair[0] < pair[1])
one_swap = st.one_of(
    two.map(lambda pair: Wiring(tubes=(pair,))),
    two.map(lambda pair: Wiring(sensors=(pair,))),
    two.map(lambda pair: Wiring(valves=((f"fill{pair[0]}", f"fill{pair[1]}"),))),
    two.map(lambda pair: Wiring(valves=((f"vent{pair[0]}", f"vent{pair[1]}"),))),
    bubbles.map(lambda i: Wiring(valves=((f"fill{i}", f"vent{i}"),))),
    st.sampled_from(valve_names(N)).map(lambda valve: Wiring(dead=(valve,))),
)


@pytest.mark.medium
@given(one_swap)
def test_one_mistake_is_named(wiring):
    assert alike(told(diagnose(wiring)), wiring)


def both(one: Wiring, other: Wiring) -> Wiring:
    return Wiring(
        one.tubes + other.tubes, one.valves + other.valves, one.sensors + other.sensors, one.dead + other.dead
    )


def parts(wiring: Wiring) -> set[int]:
    pairs = (*wiring.tubes, *wiring.sensors, *wiring.valves, wiring.dead)
    return {int(str(part)[-1]) for pair in pairs for part in pair}


apart = st.tuples(one_swap, one_swap).filter(lambda two: not parts(two[0]) & parts(two[1]))


@pytest.mark.medium
@given(apart)
def test_two_mistakes_of_different_places_are_named(mistakes):
    wiring = both(*mistakes)
    assert alike(told(diagnose(wiring)), wiring)


plugs = st.sampled_from(["tubes", "sensors", "fill", "vent"])


@pytest.mark.medium
@given(two, st.lists(plugs, min_size=2, max_size=3, unique=True))
def test_several_swaps_of_the_same_two_places_are_named_or_what_does_the_same(pair, kinds):
    i, j = pair
    wiring = Wiring(
        tubes=(pair,) * ("tubes" in kinds),
        sensors=(pair,) * ("sensors" in kinds),
        valves=tuple((f"{kind}{i}", f"{kind}{j}") for kind in ("fill", "vent") if kind in kinds),
    )
    findings = diagnose(wiring)
    assert alike(told(findings), wiring)
    assert len(findings) <= len(kinds), "never more plugs to move than were moved"


@pytest.mark.parametrize(
    "wiring",
    [Wiring(valves=(("fill1", "fill4"), ("vent1", "vent4"))), Wiring(tubes=((1, 4),), valves=(("fill1", "fill4"),))],
)
def test_where_two_ways_are_as_likely_both_are_said(wiring):
    assert any("The same would be seen of" in finding.seen for finding in diagnose(wiring))
    assert not any("The same would be seen of" in finding.seen for finding in diagnose(Wiring(tubes=((1, 4),))))


@pytest.mark.parametrize(("kind", "name"), [("tubes", "tubes_swapped"), ("sensors", "sensor_wires_swapped")])
def test_three_that_are_turned_round_are_named_together(kind, name):
    """Two swaps that share a place: 1 leads to 2, 2 to 3, 3 to 1."""
    findings = diagnose(Wiring(**{kind: ((1, 2), (2, 3))}))
    assert names(findings) == [name]
    assert [int(part.split()[-1]) for part in findings[0].parts] == [1, 2, 3]


def test_a_vent_of_one_on_the_fill_of_another():
    findings = diagnose(Wiring(valves=(("fill2", "vent5"),)))
    assert [finding.parts for finding in findings] == [("vent valve 5", "fill valve 2")]


def test_a_vent_that_never_opens_is_no_swap():
    findings = diagnose(Wiring(), stuck=(3,))
    assert [(finding.name, finding.parts) for finding in findings] == [("vent_valve_stuck", ("vent valve 3",))]


def test_a_bubble_that_was_not_pushed_on_again():
    board, pulses = IdealBoard(Wiring(), N), wires.Pulses()
    for bubble in range(N):
        pulses.add(board.pulse((bubble,), bubble))
        lost = board.pulse((), None) if bubble == 2 else board.pulse((bubble,), None)
        pulses.each[(bubble,), None] = lost
    assert [(finding.name, finding.parts) for finding in wires.diagnose(pulses, range(N))] == [
        ("bubble_off", ("bubble 2",))
    ]


def test_what_was_heard_says_where_to_look_first():
    silent = diagnose(Wiring(dead=("fill3", "vent3")), heard=False)
    clicked = diagnose(Wiring(dead=("fill3",)), heard=True)
    assert "Nothing clicked" in silent[0].remedy
    assert "Nothing clicked" not in clicked[0].remedy
