"""Bubbles of the simulated plant push each other as the model says, and order matters through the whole chain."""

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin import boards
from bubbleskin.sim.plant import SUBSTEP, Plant, PlantParameters
from bubbleskin.sim.recipe import make_plant

FLAT = 5.0
TALL = 12.0
CENTRE = np.array([TALL] + [FLAT] * 6)
RING = np.array([FLAT] + [TALL] * 6)
ALL = np.full(7, TALL)
ORDERS = {"alone": [CENTRE], "ring first": [RING, ALL], "together": [ALL], "centre first": [CENTRE, ALL]}


def heights_after(order, url="sim://wristband7"):
    with bs.connect(url) as skin:
        for shape in ORDERS[order]:
            skin.show(shape, wait=False, plan=False)
            skin.sleep(1.5)
        return skin.simulated.height_mm, skin.simulated.plant.pressure_pa


@pytest.mark.medium
@pytest.mark.parametrize("seed", [0, 3])
def test_the_papers_three_heights_through_firmware_and_valves(seed):
    shapes = {order: heights_after(order, f"sim://wristband7?seed={seed}")[0] for order in ORDERS}
    centre = {order: shape[0] for order, shape in shapes.items()}
    assert centre["alone"] == pytest.approx(12.0, abs=0.1)
    assert centre["ring first"] == pytest.approx(centre["alone"], abs=0.4)
    assert centre["centre first"] == pytest.approx(14.0, abs=0.2)
    # All at once, there is no room for all: the centre or some of the ring are lifted, and which is chance.
    together = shapes["together"]
    lifted = together > (12 + 14) / 2
    assert 1 <= lifted.sum() <= 3
    assert together == pytest.approx(np.where(lifted, 14.0, 12.0), abs=0.4)


@pytest.mark.parametrize("order", ["alone", "centre first"])
def test_the_plant_rests_where_the_model_does(order):
    """The plant integrates membranes and air in time; the model follows equilibria. Same pressures, same order."""
    true, pressure = heights_after(order)
    model = bs.CompliantContact(bs.Layout.hexagon(1))
    steps = [np.where(shape > FLAT, pressure, 0.0) for shape in ORDERS[order]]
    assert true == pytest.approx(model.settle(steps).height_mm, abs=0.03)


def test_a_bubble_that_nobody_touches_is_as_if_it_were_alone():
    together, alone = (make_plant(boards.load("wristband7"), 1, 0.0, contact) for contact in (True, False))
    for plant in (together, alone):
        for on in [5e-3] * 30 + [0.0] * 100:
            plant.advance(5e-3, [on] + [0.0] * 6, [0.0] + [5e-3] * 6, pump=0.5)
    assert together.height_mm[0] == pytest.approx(alone.height_mm[0], abs=2e-3)
    assert alone.height_mm[0] > 9


def test_a_squeezed_plant_comes_back_when_its_neighbours_have_gone():
    plant = make_plant(boards.load("wristband7"), 2, 0.0, True)
    plant.rest_at([TALL] * 7)
    for vent in ([0.0] * 7, [0.0] + [5e-3] * 6):
        for _ in range(300):
            plant.advance(5e-3, np.zeros(7), vent)
    assert plant.position_m[0, :2] == pytest.approx(0.0, abs=5e-5)
    assert plant.height_mm[1:] == pytest.approx(FLAT, abs=0.05)


def test_snapshots_hold_the_places_too():
    plant = make_plant(boards.load("wristband7"), 2, 0.0, True)
    plant.rest_at([TALL] * 7)
    snapshot = plant.snapshot()

    def run():
        for _ in range(50):
            plant.advance(5e-3, np.zeros(7), np.zeros(7))
        return plant.height_mm.tobytes()

    first = run()
    plant.restore(snapshot)
    assert run() == first


@pytest.mark.medium
def test_the_step_is_as_fine_as_its_docstring_says():
    """Filled and vented by pulses, held for half a second; nothing is flung to another place."""

    def heights(contact, substep):
        model = bs.CompliantContact(bs.Layout.hexagon(rings=1)) if contact else None
        plant = Plant(PlantParameters.spread(7, 0.1, 1), seed=1, substep=substep, contact=model)
        rng = np.random.default_rng(3)
        seen = []
        for tick in range(400):
            pulses = rng.uniform(0, 4e-3, 7) * (rng.random(7) < 0.4)
            fill, vent = pulses * (tick < 240), pulses * (240 <= tick < 300)
            plant.advance(5e-3, fill, vent, pump=1.0)
            seen.append(plant.height_mm)
        return np.array(seen)

    for contact, moving_um in ((False, 1.0), (True, 10.0)):
        fine = heights(contact, 5e-6)
        wrong_um = 1e3 * np.abs(heights(contact, SUBSTEP) - fine)
        assert fine.max() > 12.0
        assert wrong_um.max() < moving_um
        assert wrong_um[-1].max() < 1.0
        assert not contact or np.abs(fine - heights(False, 5e-6)).max() > 0.5


def test_a_contact_for_another_number_of_bubbles_is_refused():
    with pytest.raises(bs.InvalidInput, match="7 bubbles, the plant has 3"):
        Plant(PlantParameters.nominal(3), contact=bs.CompliantContact(bs.Layout.hexagon(1)))


@pytest.mark.parametrize(("make", "height"), [(bs.sequences.pop_up, 14.0), (bs.sequences.flat_twin, 12.0)])
def test_the_same_targets_in_two_orders_as_sequences_that_the_device_plays(make, height):
    with bs.connect("sim://wristband7?seed=1") as skin:
        skin.play(make(skin.layout, high_mm=TALL), anyway=True)
        assert skin.simulated.height_mm[0] == pytest.approx(height, abs=0.2 if height > TALL else 0.4)
