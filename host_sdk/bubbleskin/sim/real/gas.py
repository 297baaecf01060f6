"""Air that takes up and gives off heat.

An amount of air is A = m R T0, J, with T0 that of ISO 6358: mass, in the unit in which the firmware meters it. A vessel holds
A and E = pV = A θ with θ = T/T0, its internal energy but for a factor γ − 1, so that of a flow RTṁ that comes in at θ

    dA/dt = flow/θ        dE/dt = γ flow − (γ − 1) p dV/dt − (E − A θw)/τ

The polytropic exponent is a result: γ where nothing has time to warm, 1 where everything has.
"""

HEAT_RATIO = 1.4
"""γ = cp/cv of air."""


def expanded(energy: float, before: float, after: float) -> float:
    """E = pV after its volume has changed by little, with no heat: E V^(γ − 1) is constant, to the third order of the change."""
    a = (HEAT_RATIO - 1.0) * (after - before) / (after + before)
    return energy * (1.0 - a) / (1.0 + a)


def cooled(energy: float, air: float, wall: float, time: float, h: float) -> float:
    """E after `h` s beside a wall at θw = `wall`: a backward step, so that no time constant is too short."""
    rest = air * wall
    return rest + (energy - rest) / (1.0 + h / time)
