"""The simulation of ``linear_simulation.py`` with half of the elevator's deflection: a second ``--sim``."""

from linear_simulation import ELEVATOR
from linear_simulation import wrench as sound


def wrench(time, state, effector, air, parameters):
    """Return forces and moments, N and N m, where the air feels half of the elevator's way from trim."""
    felt = ELEVATOR + 0.5 * (effector["de"] - ELEVATOR)
    return sound(time, state, {**effector, "de": felt}, air, parameters)


wrench.responses = sound.responses
