"""Airspeed, angle of attack, pitch rate and pitch angle, with coefficients of X, Z and pitch moment."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from freqid.core.units import STANDARD_GRAVITY
from freqid.identify.output_error.forms.form import (
    COEFFICIENT,
    Form,
    Loads,
    chosen,
    output_biases,
)
from freqid.identify.output_error.forms.moments import PITCH, pitch_acceleration
from freqid.identify.output_error.model import DynamicModel, Named

STATES = ("V", "alpha", "q", "theta")


def build(loads: Loads) -> DynamicModel:
    """Return the model; density, roll and yaw rate and bank angle are inputs, airspeed gives qbar.

    Notes
    -----
    ``V' = (X cos(alpha) + Z sin(alpha)) / m + gravity``, ``alpha' = q + (Z cos(alpha) - X sin(alpha)) / (m V)
    + gravity``, ``theta' = q cos(phi) - r sin(phi)``, with a bias of its own; no sideslip
    (Klein & Morelli, 2nd ed., ch. 3).
    """
    biases = output_biases(loads, ("ax", "az"))

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        speed, alpha, theta = x["V"], x["alpha"], x["theta"]
        applied = loads.of(x, u, p, 0.5 * u["rho"] * speed**2)
        along: Any = applied["X"] / u["mass_kg"]
        down: Any = applied["Z"] / u["mass_kg"]
        forward = along - STANDARD_GRAVITY * jnp.sin(theta)
        downward = down + STANDARD_GRAVITY * jnp.cos(theta) * jnp.cos(u["phi"])
        rates = {
            "V": forward * jnp.cos(alpha) + downward * jnp.sin(alpha),
            "alpha": x["q"] + (downward * jnp.cos(alpha) - forward * jnp.sin(alpha)) / speed,
            "q": pitch_acceleration(applied["M"], u["p"], u["r"], u),
            "theta": x["q"] * jnp.cos(u["phi"]) - u["r"] * jnp.sin(u["phi"]) + p["bias_theta_rate"],
        }
        seen = {"ax": along + p.get("bias_ax", 0.0), "az": down + p.get("bias_az", 0.0)}
        return rates, chosen({**x, **seen}, loads)

    return DynamicModel(
        "longitudinal, coefficients",
        STATES,
        loads.inputs(STATES, ("rho", "p", "r", "phi", "mass_kg", *PITCH)),
        loads.outputs,
        (*loads.parameters, "bias_theta_rate", *biases),
        equations,
        own=(*loads.biases, "bias_theta_rate", *biases),
    )


FORM = Form("longitudinal, coefficients", ("X", "Z", "M"), COEFFICIENT, (*STATES, "ax", "az"), build)
