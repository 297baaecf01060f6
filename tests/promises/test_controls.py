"""Every promise judged in conftest.py against a firmware with the rule taken out that keeps it: the judge must see it.

Each firmware meets one short course of events, in which the whole firmware keeps every promise; some meet the search, too.
"""

import pytest
from hypothesis import Phase

from bubble_firmware.control import state_layout as layout
from bubble_firmware.safety.state import HOST_QUIET, NO_EVENT
from bubble_firmware.safety.watch_layout import OVERFILLED_BUBBLE
from bubble_protocol.schema.faults import ESTOP, LEAK, NO_AIR

ANY = 255


# Rules taken out.


def forgets(*bits, overfilled=False):
    """A monitor that does not know these faults: what it does about one of them is undone. `overfilled`: nor that."""

    def spoil(app):
        check, rows, pulses = app.fault_monitor.check, app.bubbles.rows, app.bubbles.pulses

        def check_less():
            row_before, pulses_before = list(rows), list(pulses)
            found = check()
            for bubble in range(app.bubbles.count):
                at = bubble * layout.ROW_WORDS
                left = rows[at + layout.FAULTS] & ~sum(bits)
                if rows[at + layout.FAULTS] and not left:
                    for word in range(at, at + layout.ROW_WORDS):
                        rows[word] = row_before[word]
                    for valve in (2 * bubble, 2 * bubble + 1):
                        pulses[valve] = pulses_before[valve]
                rows[at + layout.FAULTS] = left
            return found & ~OVERFILLED_BUBBLE if overfilled else found

        app.fault_monitor.check = check_less

    return spoil


blind = forgets(ANY, overfilled=True)


def does_not_isolate(app):
    """Faults are found and told, and the valves go on as decided."""
    check, pulses = app.fault_monitor.check, app.bubbles.pulses

    def check_only():
        before = list(pulses)
        found = check()
        for valve, pulse in enumerate(before):
            pulses[valve] = pulse
        return found & ~OVERFILLED_BUBBLE

    app.fault_monitor.check = check_only


def isolates_neighbours(app):
    """What one bubble has, the next one has too."""
    check, rows = app.fault_monitor.check, app.bubbles.rows

    def check_more():
        found = check()
        if rows[layout.FAULTS]:
            rows[layout.ROW_WORDS + layout.FAULTS] |= rows[layout.FAULTS]
            app.fault_monitor.open_vents()
        return found

    app.fault_monitor.check = check_more


def heals(app):
    """A fault is forgotten as soon as it has been told."""
    check = app.fault_monitor.check

    def check_anew():
        for bubble in range(app.bubbles.count):
            app.bubbles.clear_faults(bubble)
        return check()

    app.fault_monitor.check = check_anew


def releases_at_once(app):
    """An acknowledgement ends an isolation."""

    def release():
        for bubble in range(app.bubbles.count):
            app.bubbles.clear_faults(bubble)
        return False

    app.faults.release = release


def fills_on(app):
    """A fill valve that has opened stays open, whatever comes of it."""
    pulses, tick_us = app.bubbles.pulses, app.board.TICK_US
    opened = []

    def check():
        if pulses[0] and not opened:
            opened.append(True)
        if opened:
            pulses[0], pulses[1] = tick_us, 0
            app.bubbles.clear_faults(0)
        return 0

    app.fault_monitor.check = check


def deaf(app):
    """A deadman that never fires."""
    app.deadman.tick = lambda mode, moving: NO_EVENT


def holds_for_ever(app):
    """A deadman that holds, and does not vent."""
    tick = app.deadman.tick
    app.deadman.tick = lambda mode, moving: event if (event := tick(mode, moving)) == HOST_QUIET else NO_EVENT


def no_emergency_stop(app):
    """It is no fault of the board; the others are."""
    fault = app.commands.fault

    def others(board_faults):
        if board_faults & ~ESTOP or app.supply.lost:
            fault(board_faults & ~ESTOP)

    app.commands.fault = others


def does_not_dump(app):
    """The pump goes on, whatever the reservoir's sensor says."""
    app.supply.sense = lambda count, pulses, shut: setattr(app.supply, "pump", 65535)


def believes_the_supply(app):
    """The sensor of the reservoir, however it stands still or falls silent."""
    sense, supply = app.supply.sense, app.supply

    def believing(count, pulses, shut):
        sense(count, pulses, 0)
        supply.lost = supply.dump = 0
        supply.pump = 65535 if count < 2500 else 0

    app.supply.sense = believing


def misreads(app):
    """The first bubble's sensor, at the end of its range."""
    read = app.hal.read_sensors

    def wrong(counts):
        read(counts)
        counts[0] = 4095

    app.hal.read_sensors = wrong


# Courses of events: (seconds, what then happens).


def fails(failure, value, after=0.3, height_um=14_000, contact=False):
    """A bubble on its way to a height, and what happens to it."""

    def course(make, spoil=None):
        world = make(host=spoil, contact=contact)
        world.run(0.3)
        world.show([height_um] * world.bubbles, 0)
        world.run(after)
        world.inject(failure, 0, value)
        world.run(3.0)
        return world

    return course


def then(course, *acts):
    """More after it: names of what a world can do with what it is given, or seconds."""

    def longer(make, spoil=None):
        world = course(make, spoil)
        for act in acts:
            if isinstance(act, tuple):
                getattr(world, act[0])(*act[1:])
            else:
                world.run(act)
        return world

    return longer


def shown(make, spoil=None):
    world = make(host=spoil)
    world.run(0.3)
    world.show([9000] * world.bubbles, 0)
    world.run(0.5)
    return world


popped = fails("pop_off", 1.0, height_um=9000)
ill = fails("sensor_absent", 1.0, height_um=9000)
deceived = then(shown, ("inject_supply", "supply_stuck", 2160.0), 20.0)
acknowledged = then(shown, ("inject", "sensor_stuck", 0, 1460.0), 0.6, ("clear",), 0.5)
CONTROLS = {
    "pressure: no fault is known": ("pressure", blind, fails("sensor_stuck", 700.0, contact=True)),
    "height: air that is missing is not": ("height", forgets(LEAK, NO_AIR), fails("sensor_stuck", 700.0)),
    "height: a stuck fill valve is not": ("height", blind, fails("fill_stuck", 1.0)),
    "reservoir: no dump valve": ("reservoir", does_not_dump, shown),
    "reservoir: its sensor is believed": ("reservoir", believes_the_supply, deceived),
    "silence: no deadman": ("silence", deaf, then(shown, ("fall_silent",), 2.0)),
    "silence: held for ever": ("silence", holds_for_ever, then(shown, ("fall_silent",), 2.0)),
    "emergency stop": ("emergency stop", no_emergency_stop, then(shown, ("press", True), 0.5)),
    "on-time": ("on-time", fills_on, fails("pop_off", 1.0, after=0.0)),
    "isolation: told only": ("isolation", does_not_isolate, popped),
    "isolation: too short": ("isolation", releases_at_once, acknowledged),
    "only the ill": ("only the ill", isolates_neighbours, ill),
    "latching": ("latching", heals, popped),
}


@pytest.mark.parametrize("name", CONTROLS)
def test_a_firmware_without_the_rule_is_seen(name, world):
    promise, spoil, course = CONTROLS[name]
    with pytest.raises(world.Broken, match=f"^{promise}: "):
        course(world, spoil)


@pytest.mark.medium
@pytest.mark.parametrize("name", CONTROLS)
def test_with_the_rule_the_same_is_kept(name, world):
    _, _, course = CONTROLS[name]
    course(world)


def test_every_promise_has_a_control(world):
    assert {promise for promise, _, _ in CONTROLS.values()} == set(world.promises)


SEARCHED = {
    "silence": deaf,
    "pressure|height|isolation": blind,
    "latching": heals,
    "emergency stop": no_emergency_stop,
    "reservoir": does_not_dump,
    "only the ill": misreads,
}


@pytest.mark.slow
@pytest.mark.parametrize("promise", SEARCHED)
def test_the_search_finds_a_firmware_without_the_rule(promise, world, look):
    with pytest.raises(world.Broken, match=f"^({promise}): "):
        look(2000, SEARCHED[promise], (Phase.generate,))
