"""The fit itself, on air and pressures that are made without a plant."""

import numpy as np

from bubbleskin import boards
from bubbleskin.calibrate import fit, rubber
from bubbleskin.calibrate.data import Data
from bubbleskin.calibrate.metering import Valve
from bubbleskin.calibrate.nominal import Nominal, sphere_mm3

NOMINAL = Nominal.of(boards.load("wristband7"))
ATMOSPHERE = 101_325.0
TICK_S, MEAN = 0.005, 12


def data_of(values):
    """A bubble of these values, up to 12 mm and back in stairs, twice: what a perfect board would tell of it."""
    way = np.concatenate([np.linspace(5.5, 12.0, 12), np.linspace(12.0, 5.5, 12)])
    height = np.repeat([2 * values[fit.RADIUS], *way, *way], MEAN)  # it begins empty
    pressure = rubber.history(height / (2 * values[fit.RADIUS]), TICK_S, fit.wall_of(values))
    air = 1e-3 * (ATMOSPHERE + pressure) * (values[fit.LINE] + sphere_mm3(height))
    moved = np.diff(air, prepend=air[0])
    nothing = np.zeros(len(air))
    fill, vent = (
        Valve(air=np.cumsum(np.maximum(way, 0.0)), late=nothing, rate=nothing, flowing=nothing, active=nothing > 0)
        for way in (moved, -moved)
    )
    first = np.arange(MEAN, len(air), MEAN)
    return Data(
        tick_s=TICK_S,
        atmosphere=ATMOSPHERE,
        pressure=pressure,
        fill=fill,
        vent=vent,
        kpa_seconds=nothing,
        anchors=np.zeros(len(air), np.int64),
        lift=0.0,
        first=first,
        count=np.full(len(first), MEAN),
    )


def test_what_it_is_made_of_is_found():
    values, _ = fit.beforehand(NOMINAL)
    values[fit.QUICK], values[fit.SLOW] = 0.08, 0.02
    found = fit.fit(data_of(values), NOMINAL)
    assert found.rms_pa < 60.0
    assert abs(found.values[fit.QUICK] - 0.08) < 0.02


def test_no_rubber_gains_pressure_by_being_stretched():
    """Pressures that say so are those of a sensor or a model that is off: memory and softening end at none."""
    values, _ = fit.beforehand(NOMINAL)
    values[[fit.SOFTENING, fit.QUICK, fit.SLOW]] = -0.1
    found = fit.fit(data_of(values), NOMINAL)
    assert (found.values[[fit.MU, fit.C2, fit.C3, fit.SOFTENING, fit.QUICK, fit.SLOW]] >= 0.0).all()
