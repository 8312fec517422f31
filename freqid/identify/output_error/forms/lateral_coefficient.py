"""Sideslip, roll rate, yaw rate and bank angle, with coefficients of side force, roll and yaw moment."""

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
from freqid.identify.output_error.forms.moments import ROLL_AND_YAW, roll_and_yaw_acceleration
from freqid.identify.output_error.model import DynamicModel, Named

STATES = ("beta", "p", "r", "phi")


def build(loads: Loads) -> DynamicModel:
    """Return the model; airspeed, angle of attack, pitch rate and angle, and dynamic pressure are inputs.

    Notes
    -----
    ``beta' = Y / (m V) + p sin(alpha) - r cos(alpha) + g cos(theta) sin(phi) / V``, sideslip small (Klein &
    Morelli, 2nd ed., ch. 3); ``phi' = p + tan(theta) (q sin(phi) + r cos(phi))``, with a bias of its own.
    """
    biases = output_biases(loads, ("ay",))

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        applied = loads.of(x, u, p, u["qbar"])
        side: Any = applied["Y"] / u["mass_kg"]
        gravity = STANDARD_GRAVITY * jnp.cos(u["theta"]) * jnp.sin(x["phi"])
        roll, yaw = roll_and_yaw_acceleration(applied, x["p"], u["q"], x["r"], u)
        rates = {
            "beta": (side + gravity) / u["V"] + x["p"] * jnp.sin(u["alpha"]) - x["r"] * jnp.cos(u["alpha"]),
            "p": roll,
            "r": yaw,
            "phi": x["p"]
            + jnp.tan(u["theta"]) * (u["q"] * jnp.sin(x["phi"]) + x["r"] * jnp.cos(x["phi"]))
            + p["bias_phi_rate"],
        }
        return rates, chosen({**x, "ay": side + p.get("bias_ay", 0.0)}, loads)

    return DynamicModel(
        "lateral, coefficients",
        STATES,
        loads.inputs(STATES, ("V", "alpha", "q", "theta", "qbar", "mass_kg", *ROLL_AND_YAW)),
        loads.outputs,
        (*loads.parameters, "bias_phi_rate", *biases),
        equations,
        own=(*loads.biases, "bias_phi_rate", *biases),
    )


FORM = Form("lateral, coefficients", ("Y", "L", "N"), COEFFICIENT, (*STATES, "ay"), build)
