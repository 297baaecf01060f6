"""Bubbles that push each other: elastic spheres on soft necks over a base plane, each with springs of its own.

`place` is (n, 4) m: centre x, y, z and radius R of each. A sphere is pulled towards its barb sideways; where it is lifted off the
base its neck pulls it back, where it is pushed into the base this pushes it up, both along z − neck − R. Two spheres that overlap
by δ push each other apart along the line of their centres with k δ; both sides give, so k is their harmonic mean. The same
forces press on the walls: the work of k δ dδ is shared by the centres and by both radii.
"""

import math

from bubbleskin.native import njit
from bubbleskin.sim.records import DRAG


@njit
def push(place, barbs, constants, pairs, force, h):  # type: ignore[no-untyped-def]
    """Let centres move for `h` s. Leaves in `force` (n, 4) N what acted on them, and with what each wall is pressed on."""
    for i in range(len(place)):
        p = constants[i]
        lift = place[i, 2] - place[i, 3] - p.neck
        stiffness = p.kz_up if lift > 0.0 else p.kz_down
        force[i, 0] = p.kxy * (barbs[i, 0] - place[i, 0])
        force[i, 1] = p.kxy * (barbs[i, 1] - place[i, 1])
        force[i, 2] = -stiffness * lift
        # A larger sphere is lifted less: the neck's pull helps the air, the base's push does not.
        force[i, 3] = force[i, 2]
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        dx, dy, dz = place[i, 0] - place[j, 0], place[i, 1] - place[j, 1], place[i, 2] - place[j, 2]
        reach = place[i, 3] + place[j, 3]
        square = dx * dx + dy * dy + dz * dz
        if square < reach * reach:
            distance = max(math.sqrt(square), 1e-12)
            one, other = constants[i].kc, constants[j].kc
            press = 2.0 * one * other / (one + other) * (reach - distance)
            per_metre = press / distance
            force[i, 0] += per_metre * dx
            force[i, 1] += per_metre * dy
            force[i, 2] += per_metre * dz
            force[j, 0] -= per_metre * dx
            force[j, 1] -= per_metre * dy
            force[j, 2] -= per_metre * dz
            force[i, 3] += press
            force[j, 3] += press
    for i in range(len(place)):
        p = constants[i]
        # DRAG dx/dt = force; the own spring taken at the end of the step, so that the stiff base needs no finer one.
        stiffness = p.kz_up if place[i, 2] - place[i, 3] > p.neck else p.kz_down
        place[i, 0] += h * force[i, 0] / (DRAG + h * p.kxy)
        place[i, 1] += h * force[i, 1] / (DRAG + h * p.kxy)
        place[i, 2] += h * force[i, 2] / (DRAG + h * stiffness)
