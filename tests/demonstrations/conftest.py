"""What the demonstrations' tests share."""

import pytest

import bubbleskin as bs


@pytest.fixture
def layout():
    return bs.Layout.hexagon(1)


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7?contact=0") as skin:
        yield skin
