"""Lateral velocity, roll rate, yaw rate and bank angle, with side force, roll and yaw moment."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from freqid.core.units import STANDARD_GRAVITY
from freqid.identify.output_error.forms.form import (
    DIMENSIONAL,
    Form,
    Loads,
    chosen,
    output_biases,
)
from freqid.identify.output_error.forms.moments import ROLL_AND_YAW, roll_and_yaw_acceleration
from freqid.identify.output_error.model import DynamicModel, Named

STATES = ("v", "p", "r", "phi")


def build(loads: Loads) -> DynamicModel:
    """Return the model; forward and vertical velocity, pitch rate and pitch angle are inputs.

    Notes
    -----
    ``v' = Y / m + g cos(theta) sin(phi) + p w - r u``; ``phi' = p + tan(theta) (q sin(phi) + r
    cos(phi))``, with a bias of its own (Klein & Morelli, 2nd ed., ch. 3).
    """
    biases = output_biases(loads, ("ay",))

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        applied = loads.of(x, u, p)
        side: Any = applied["Y"] / u["mass_kg"]
        roll, yaw = roll_and_yaw_acceleration(applied, x["p"], u["q"], x["r"], u)
        gravity = STANDARD_GRAVITY * jnp.cos(u["theta"]) * jnp.sin(x["phi"])
        rates = {
            "v": side + gravity + x["p"] * u["w"] - x["r"] * u["u"],
            "p": roll,
            "r": yaw,
            "phi": x["p"]
            + jnp.tan(u["theta"]) * (u["q"] * jnp.sin(x["phi"]) + x["r"] * jnp.cos(x["phi"]))
            + p["bias_phi_rate"],
        }
        return rates, chosen({**x, "ay": side + p.get("bias_ay", 0.0)}, loads)

    return DynamicModel(
        "lateral",
        STATES,
        loads.inputs(STATES, ("u", "w", "q", "theta", "mass_kg", *ROLL_AND_YAW)),
        loads.outputs,
        (*loads.parameters, "bias_phi_rate", *biases),
        equations,
        own=(*loads.biases, "bias_phi_rate", *biases),
    )


FORM = Form("lateral", ("Y", "L", "N"), DIMENSIONAL, (*STATES, "ay"), build)
