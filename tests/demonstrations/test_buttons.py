"""Digital buttons: hover, press, drag, and what they do."""

import io

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.demonstrations.buttons import Buttons
from bubbleskin.demonstrations.keyboard import Keyboard, keys


@pytest.fixture
def shown():
    return []


@pytest.fixture
def buttons(layout, shown):
    return Buttons(layout, lambda heights: shown.append(heights.tolist()), rest_mm=5.5, peek_mm=7, raised_mm=12)


def test_a_bubble_peeks_out_where_the_pointer_is(buttons, shown):
    buttons.hover(2)
    buttons.hover(2)
    buttons.hover(3)
    buttons.hover(None)
    peeking = [[bubble for bubble, height in enumerate(heights) if height == 7] for heights in shown]
    assert peeking == [[2], [3], []], "and is shown only when it changes"
    assert shown[2] == [5.5] * 7


def test_a_pressed_bubble_rises_acts_and_goes_down_again(buttons, shown):
    done = []
    buttons.on_press(4, done.append)
    buttons.on_press(4, lambda bubble: done.append((bubble, shown[-1][4])))
    buttons.on_press(5, done.append)
    assert buttons.press(4) is True
    assert done == [4, (4, 12)], "in order, once it is asked to rise"
    assert buttons.raised == {4}
    buttons.hover(4)
    assert shown[-1][4] == 12, "a pressed one does not sink to peek"
    assert buttons.press(4) is False
    assert len(done) == 2, "going down does nothing"
    assert shown[-1][4] == 7


def test_dragging_paints_each_bubble_once(buttons, shown):
    done = []
    for bubble in range(7):
        buttons.on_press(bubble, done.append)
    for bubble in (1, 1, 0, 4, 0):
        buttons.drag(bubble)
    assert done == [1, 0, 4]
    assert buttons.raised == {0, 1, 4}
    assert len(shown) == 3
    buttons.clear()
    assert shown[-1] == [7] + [5.5] * 6, "the pointer is still over bubble 0"


def test_places_are_bubbles(buttons, layout):
    for bubble, (x, y) in enumerate(layout.positions_mm):
        assert buttons.at(x + 3, y - 3) == bubble
    assert buttons.at(50, 0) is None


def test_a_bubble_lies_beside_another_in_a_direction(buttons):
    """Of a hexagon: 1 is on the right, then counterclockwise."""
    assert buttons.beside(None, 1, 0) == 0
    assert [buttons.beside(0, x, y) for x, y in ((1, 0), (1, 2), (-1, 2), (-1, 0), (-1, -2), (1, -2))] == [
        1,
        2,
        3,
        4,
        5,
        6,
    ]
    assert buttons.beside(1, 1, 0) == 1, "nothing is further right"


def test_keys_do_what_the_pointer_does(buttons):
    keyboard = Keyboard(buttons)
    assert keys("\x1b[C \x1b[Dq") == ["\x1b[C", " ", "\x1b[D", "q"]
    assert all(keyboard.take(key) for key in keys(" \x1b[C\x1b[C p\x1b[D4"))
    assert buttons.raised == {0, 1, 4}
    assert buttons.hovered == 4
    assert keyboard.take("c")
    assert buttons.raised == frozenset()
    assert keyboard.take("9"), "no such bubble: nothing happens"
    assert not keyboard.take("q")
    assert not keyboard.take(*keys("")), "the input has ended"


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda buttons: buttons.press(7), "number of the bubble is 7; 0 to 6"),
        (lambda buttons: buttons.on_press(1, "beep"), "give a function"),
        (lambda buttons: Buttons(buttons.layout, None), "give a function"),
        (lambda buttons: Buttons(buttons.layout, print, rest_mm=8), "peek_mm is 7 mm; 8 mm or more"),
        (lambda buttons: Buttons("hexagon", print), "give a Layout"),
    ],
)
def test_what_cannot_be_meant_is_refused(buttons, ask, words):
    with pytest.raises(bs.InvalidInput, match=words):
        ask(buttons)


def test_the_bubbles_of_a_wristband_rise(skin):
    """The plant's true heights."""
    buttons = Buttons.on(skin)
    buttons.hover(3)
    skin.sleep(0.6)
    assert np.abs(skin.simulated.height_mm - [5, 5, 5, 7, 5, 5, 5]).max() < 0.2
    buttons.press(3)
    skin.sleep(0.8)
    assert np.abs(skin.simulated.height_mm - [5, 5, 5, 12, 5, 5, 5]).max() < 0.2


def test_the_command_takes_keys(command, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(" l 3"))
    status, out, err = command("demo", "buttons", "--device", "sim://wristband7")
    assert (status, err) == (0, "")
    assert out.splitlines() == [f"Bubble {bubble} was pressed." for bubble in (0, 1, 3)]
