"""Which wires and tubes are swapped, which valves do nothing: from pulses to names.

A manifold has a place for each bubble, with a fill valve, a vent valve, a sensor and a tube. Pulses say where each output and
each sensor leads, by the bubble at the far end: *F(i)* is the bubble that output fill *i* lets air into, *V(i)* the one that
output vent *i* shuts, *S(i)* the one whose pressure sensor input *i* reads. With all bubbles on, SHOW of bubble *i* gives *F(i)*
a pulse; the sensor that sees it is *S⁻¹(F(i))*, and the pressure stays only where *V(i) = F(i)*. With one bubble pulled off, the
line whose pressure is gone at once is that bubble's.

The firmware opens no single valve, so what a valve by itself does is inferred. Some mistakes do the same as others: then the one
with the fewest plugs moved is named, and the other one is said.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations

from bubbleskin.bringup.evidence import FELL, HELD, OPEN, ROSE, Pulse
from bubbleskin.bringup.findings import Finding

Lead = dict[int, int | None]
"""Where something leads: None is nowhere."""
_LEFT_KPA, _LEFT_SHARE = 1.0, 0.5
_PLUGS = {
    "fill": ("fill valves", "fill_valves_swapped", "fill valve"),
    "vent": ("vent valves", "vent_valves_swapped", "vent valve"),
    "sensor": ("sensor wires", "sensor_wires_swapped", "sensor"),
}


@dataclass
class Pulses:
    """All pulses so far, by who was asked and who was off."""

    each: dict[tuple[tuple[int, ...], int | None], Pulse] = field(default_factory=dict)

    def add(self, pulse: Pulse) -> None:
        """Another one."""
        self.each[pulse.asked, pulse.off] = pulse

    def of(self, asked: Iterable[int], off: int | None = None) -> Pulse | None:
        """The pulse of these bubbles, where there was one."""
        return self.each.get((tuple(sorted(asked)), off))


def strange(pulses: Pulses, bubbles: Sequence[int]) -> list[int]:
    """The bubbles whose two pulses, off their barb and on it, are not those of a place that is wired as it should be."""
    return [
        i
        for i in bubbles
        if not _as_it_should(pulses.of([i], i), i, OPEN) or not _as_it_should(pulses.of([i]), i, HELD)
    ]


def _as_it_should(pulse: Pulse | None, bubble: int, seen: str) -> bool:
    return pulse is not None and pulse.channels == [bubble] and pulse.seen[bubble] == seen and not _stays(pulse, bubble)


def _stays(pulse: Pulse, channel: int) -> bool:
    """Whether what a sensor saw was still there long after VENT."""
    return pulse.left_kpa[channel] > max(_LEFT_KPA, _LEFT_SHARE * pulse.rise_kpa[channel])


def further(pulses: Pulses, bubbles: Sequence[int]) -> list[tuple[tuple[int, ...], int | None]]:
    """The pulses that tell what strange ones have in common: who is asked, and who is off; first those with all on."""
    some = [i for i in strange(pulses, bubbles) if not crossed(pulses.of([i]))]
    if len(some) < 2:
        return []
    together = tuple(sorted(some))
    wanted: list[tuple[tuple[int, ...], int | None]] = [
        pair for pair in ((pair, None) for pair in combinations(together, 2)) if len(_fallen(pulses, pair[0])) == 2
    ]
    wanted += [(together, None)] + [(together, bubble) for bubble in together]
    return [want for want in dict.fromkeys(wanted) if want not in pulses.each]


def _fallen(pulses: Pulses, bubbles: Iterable[int]) -> list[int]:
    """Those whose pulse was seen and did not stay."""
    found = []
    for bubble in bubbles:
        pulse = pulses.of([bubble])
        if pulse and pulse.channels and pulse.seen[pulse.channels[0]] == FELL:
            found.append(bubble)
    return found


def crossed(pulse: Pulse | None) -> list[int]:
    """The sensors that saw pressure rise when the pulse was over: a fill valve is driven by the output of a vent valve."""
    return [] if pulse is None else [c for c in pulse.channels if pulse.seen[c] == ROSE]


def diagnose(pulses: Pulses, bubbles: Sequence[int]) -> list[Finding]:
    """What is swapped, what does nothing, and what does not let go."""
    some = strange(pulses, bubbles)
    findings = _crossings(pulses, some)
    taken = {i for i in some if crossed(pulses.of([i]))}
    taken |= {int(part.split()[-1]) for finding in findings for part in finding.parts}
    rest = [i for i in some if i not in taken]
    stuck = [i for i in rest if (pulse := pulses.of([i])) and any(_stays(pulse, c) for c in pulse.channels)]
    findings += [_stuck_vent(pulses, i) for i in stuck]
    rest = [i for i in rest if i not in stuck]
    mute = [i for i in rest if (pulse := pulses.of([i])) is None or not pulse.channels]
    findings += [_no_air(pulses, i) for i in mute]
    fill, vent, sensor = leads(pulses, [i for i in rest if i not in mute], rest)
    for group in _groups(rest, (fill, vent, sensor)):
        findings += _swaps(group, {"fill": fill, "vent": vent, "sensor": sensor})
    findings += [_dead_vent(pulses, i) for i, to in vent.items() if to is None and i not in mute]
    return findings


def leads(pulses: Pulses, heard: Sequence[int], all_strange: Sequence[int]) -> tuple[Lead, Lead, Lead]:
    """*F*, *V* and *S* of the strange bubbles; those of a fill valve that lets no air in are nowhere, or not known: their own."""
    together = tuple(sorted(all_strange))
    sensor: Lead = {i: i for i in all_strange}
    for bubble in together:
        pulse = pulses.of(together, bubble)
        opened = [c for c, seen in enumerate(pulse.seen) if seen == OPEN] if pulse else []
        if len(opened) == 1 and opened[0] in sensor:
            sensor[opened[0]] = bubble
    sensor = _one_to_one(sensor)
    fill: Lead = dict.fromkeys(all_strange)
    vent: Lead = dict.fromkeys(all_strange)
    channel = {i: _of(pulses, i).channels[0] for i in heard}
    for i in heard:
        fill[i] = sensor.get(channel[i], channel[i])
    for i in heard:
        if _of(pulses, i).seen[channel[i]] == HELD:
            vent[i] = fill[i]
        else:
            for other in heard:
                pair = pulses.of([i, other]) if other != i else None
                if (
                    pair
                    and channel[other] != channel[i]
                    and pair.seen[channel[other]] == HELD
                    and _falls(pulses, other, channel)
                ):
                    vent[i] = fill[other]
    return fill, vent, sensor


def _falls(pulses: Pulses, bubble: int, channel: dict[int, int]) -> bool:
    return _of(pulses, bubble).seen[channel[bubble]] == FELL


def _of(pulses: Pulses, bubble: int) -> Pulse:
    pulse = pulses.of([bubble])
    assert pulse is not None
    return pulse


def _one_to_one(lead: Lead) -> Lead:
    """The same, where every bubble is led to once; what is left over leads to what is left over."""
    free = [i for i in lead if i not in lead.values()]
    seen: set[int | None] = set()
    for i in sorted(lead, key=lambda i: lead[i] == i):  # what was seen before what was taken for granted
        if lead[i] in seen:
            lead[i] = free.pop(0)
        seen.add(lead[i])
    return lead


# ---- who belongs together


def _groups(bubbles: Sequence[int], all_leads: Sequence[Lead]) -> list[list[int]]:
    """The bubbles that lead to each other, in groups."""
    groups: list[set[int]] = []
    for i in bubbles:
        mine = {i} | {to for lead in all_leads if (to := lead.get(i)) is not None}
        for group in [group for group in groups if group & mine]:
            mine |= group
            groups.remove(group)
        groups.append(mine)
    return [sorted(group) for group in groups if len(group) > 1]


def _swaps(group: Sequence[int], plugs: dict[str, Lead]) -> list[Finding]:
    """What is swapped within a group, with the fewest kinds of plugs moved; and what else would do the same."""
    ways: list[tuple[int, dict[int, int]]] = []
    straight = {i: i for i in group}
    candidates = [straight]
    if len(group) <= 4:
        candidates += [
            dict(zip(group, order, strict=True)) for order in permutations(group) if list(order) != list(group)
        ]
    else:
        candidates += [{i: to for i in group if (to := lead.get(i, i)) is not None} for lead in plugs.values()]
    for tubes in candidates:
        if set(tubes) == set(tubes.values()) == set(group):
            ways.append((_cost(group, plugs, tubes), tubes))
    least = min(cost for cost, _ in ways)
    best, *others = [tubes for cost, tubes in ways if cost == least]
    also = ""
    if others:
        named = " and ".join(_named(finding) for finding in _moved(group, plugs, others[0], ""))
        also = f" The same would be seen of {named}: follow the tubes and wires of these places by eye."
    return _moved(group, plugs, best, also)


def _cost(group: Sequence[int], plugs: dict[str, Lead], tubes: dict[int, int]) -> int:
    moved = sum(_is_moved(group, lead, tubes) for lead in plugs.values())
    return moved + (tubes != {i: i for i in group})


def _is_moved(group: Sequence[int], lead: Lead, tubes: dict[int, int]) -> bool:
    return any(lead.get(i, i) not in (None, tubes[i]) for i in group)


def _moved(group: Sequence[int], plugs: dict[str, Lead], tubes: dict[int, int], also: str) -> list[Finding]:
    findings = []
    if tubes != {i: i for i in group}:
        moved = [i for i in group if tubes[i] != i]
        findings.append(
            Finding(
                "tubes_swapped",
                tuple(f"tube {i}" for i in moved),
                f"The tubes {_list(moved)} lead to each other's bubbles.",
                f"Exchange them: now {_way({i: tubes[i] for i in moved}, 'place', 'leads to bubble')}.",
                f"A pulse of one was not gone while its own bubble was off, but while the other's was.{also}",
            )
        )
    back = {to: place for place, to in tubes.items()}
    for kind, lead in plugs.items():
        to = {i: back[there] for i in group if (there := lead.get(i, i)) in back}
        moved = [i for i, place in to.items() if place != i]
        if moved and _is_moved(group, lead, tubes):
            findings.append(_plugs(kind, {i: to[i] for i in moved}, also))
    return findings


def _plugs(kind: str, to: dict[int, int], also: str) -> Finding:
    many, name, one = _PLUGS[kind]
    seen = {
        "fill": "Each pulse went into the other's line, whose vent was open.",
        "vent": "Each pulse was lost through an open vent, and stayed where both were asked to rise.",
        "sensor": "The air went to the bubble that was asked, and the other's sensor told it.",
    }[kind]
    verb = "reads the sensor of place" if kind == "sensor" else f"drives the {one} of place"
    return Finding(
        name,
        tuple(f"{one} {i}" for i in to),
        f"The wires of the {many} {_list(to)} are swapped."
        if kind != "sensor"
        else f"The {many} {_list(to)} are swapped.",
        f"Exchange their plugs: now {_way(to, 'input' if kind == 'sensor' else 'output', verb)}.",
        seen + also,
    )


def _named(finding: Finding) -> str:
    return f"{finding.name.replace('_', ' ')} ({', '.join(finding.parts)})"


def _list(numbers: Iterable[int]) -> str:
    said = [str(number) for number in numbers]
    return said[0] if len(said) == 1 else f"{', '.join(said[:-1])} and {said[-1]}"


def _way(to: dict[int, int], what: str, verb: str) -> str:
    return ", ".join(f"{what} {i} {verb} {place}" for i, place in to.items())


# ---- one place


def _crossings(pulses: Pulses, some: Sequence[int]) -> list[Finding]:
    findings = []
    for i in some:
        for channel in crossed(pulses.of([i])):
            whose = "its own fill valve" if channel == i else f"fill valve {channel}"
            findings.append(
                Finding(
                    "fill_and_vent_swapped",
                    (f"vent valve {i}", f"fill valve {channel}"),
                    f"The output of vent valve {i} drives {whose}.",
                    f"Exchange the plugs of vent valve {i} and fill valve {channel}.",
                    f"While bubble {i} was asked to rise, pressure {channel} went on rising after the pulse was over.",
                )
            )
    return findings


def _stuck_vent(pulses: Pulses, i: int) -> Finding:
    channel = next(c for c in _of(pulses, i).channels if _stays(_of(pulses, i), c))
    return Finding(
        "vent_valve_stuck",
        (f"vent valve {channel}",),
        f"Vent valve {channel} does not open.",
        f"Pull tube {channel} off to let the air out; check that the valve is a normally open one, and clean it.",
        f"Sensor {channel} still told {_of(pulses, i).left_kpa[channel]:.1f} kPa long after VENT.",
    )


def _no_air(pulses: Pulses, i: int) -> Finding:
    off = pulses.of([i], i)
    if off is not None and off.channels:
        return Finding(
            "bubble_off",
            (f"bubble {i}",),
            f"Bubble {i} is not on its barb, or has a hole.",
            f"Push bubble {i} onto its barb, and look at it.",
            "Its line took a pulse while it was off, and none stayed in it when it was to be on again.",
        )
    heard = _heard(off)
    wire = " Nothing clicked: look at its plug and its driver first." if heard is False else ""
    return Finding(
        "fill_valve_dead",
        (f"fill valve {i}",),
        f"Fill valve {i} lets no air in.",
        f"Check the wires of fill valve {i} and its driver, its tube from the reservoir, then the valve itself.{wire}",
        f"No sensor saw the pulses of bubble {i}.",
    )


def _heard(pulse: Pulse | None) -> bool | None:
    return pulse.heard if pulse else None


def _dead_vent(pulses: Pulses, i: int) -> Finding:
    return Finding(
        "vent_valve_dead",
        (f"vent valve {i}",),
        f"Vent valve {i} does not close.",
        f"Check the wires of vent valve {i} and its driver, then the valve itself; and bubble {i} and its barb for a leak.",
        f"The pulse of bubble {i} was lost in tens of milliseconds, as through an open vent, whoever else was asked to rise.",
    )
