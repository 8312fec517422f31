"""The rotors' angular momentum, which turns with the body and with the wings."""

from __future__ import annotations

import jax

from ..multibody import MassModel
from .effect import Effect, Parameter

EFFECT = Effect(
    id="gyroscopic",
    stage="airframe",
    meaning="Spinning rotors resist being turned, and push back when they are sped up.",
    parameters={"strength": Parameter(1.0, "1", "share of the rotors' angular momentum")},
    needs=("rotor",),
)


def spinning(settings: dict[str, jax.Array], mass: MassModel) -> MassModel:
    """Return the vehicle's mass with the rotors' spin scaled."""
    strength = settings["strength"]
    return mass._replace(wing_spin=strength * mass.wing_spin, body_spin=strength * mass.body_spin)
