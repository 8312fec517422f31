"""Forward and vertical velocity, pitch rate and pitch angle, with forces X and Z and pitch moment."""

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
from freqid.identify.output_error.forms.moments import PITCH, pitch_acceleration
from freqid.identify.output_error.model import DynamicModel, Named

STATES = ("u", "w", "q", "theta")


def build(loads: Loads) -> DynamicModel:
    """Return the model; lateral velocity, roll and yaw rate and bank angle are inputs.

    Notes
    -----
    ``u' = X / m - g sin(theta) - q w + r v``, ``w' = Z / m + g cos(theta) cos(phi) + q u - p v``,
    ``theta' = q cos(phi) - r sin(phi)``, with a bias of its own (Klein & Morelli, 2nd ed., ch. 3).
    """
    biases = output_biases(loads, ("ax", "az"))

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        applied = loads.of(x, u, p)
        along: Any = applied["X"] / u["mass_kg"]
        down: Any = applied["Z"] / u["mass_kg"]
        g, theta = STANDARD_GRAVITY, x["theta"]
        rates = {
            "u": along - g * jnp.sin(theta) - x["q"] * x["w"] + u["r"] * u["v"],
            "w": down + g * jnp.cos(theta) * jnp.cos(u["phi"]) + x["q"] * x["u"] - u["p"] * u["v"],
            "q": pitch_acceleration(applied["M"], u["p"], u["r"], u),
            "theta": x["q"] * jnp.cos(u["phi"]) - u["r"] * jnp.sin(u["phi"]) + p["bias_theta_rate"],
        }
        seen = {"ax": along + p.get("bias_ax", 0.0), "az": down + p.get("bias_az", 0.0)}
        return rates, chosen({**x, **seen}, loads)

    return DynamicModel(
        "longitudinal",
        STATES,
        loads.inputs(STATES, ("v", "p", "r", "phi", "mass_kg", *PITCH)),
        loads.outputs,
        (*loads.parameters, "bias_theta_rate", *biases),
        equations,
        own=(*loads.biases, "bias_theta_rate", *biases),
    )


FORM = Form("longitudinal", ("X", "Z", "M"), DIMENSIONAL, (*STATES, "ax", "az"), build)
