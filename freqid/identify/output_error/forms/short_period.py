"""Short period: angle of attack or vertical velocity, and pitch rate, at constant speed."""

from __future__ import annotations

from typing import Any

from freqid.identify.output_error.forms.form import (
    COEFFICIENT,
    DIMENSIONAL,
    Form,
    Loads,
    chosen,
    output_biases,
)
from freqid.identify.output_error.model import DynamicModel, Named


def build(loads: Loads) -> DynamicModel:
    """Return the model, in angle of attack where that is a regressor or an output, or else in w.

    Notes
    -----
    ``alpha' = Z / (m V) + q`` or ``w' = Z / m + u q``, and ``q' = M / Iyy``: linear, speed at its mean,
    gravity in the bias of Z, which is therefore not that of the accelerometer: az has one of its own (Klein &
    Morelli, 2nd ed., ch. 3).
    """
    slow = "alpha" if "alpha" in loads.factors or "alpha" in loads.outputs else "w"
    speed = "trim_V" if slow == "alpha" else "trim_u"
    states, biases = (slow, "q"), output_biases(loads, ("az",))
    coefficient = loads.form == "coefficient"

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        applied = loads.of(x, u, p, u["trim_qbar"] if coefficient else None)
        down: Any = applied["Z"] / u["mass_kg"]
        turning = down / u[speed] + x["q"] if slow == "alpha" else down + u[speed] * x["q"]
        seen = {**x, "az": down + p.get("bias_az", 0.0)}
        return {slow: turning, "q": applied["M"] / u["Iyy"]}, chosen(seen, loads)

    return DynamicModel(
        "short period",
        states,
        loads.inputs(states, (speed, "mass_kg", "Iyy", *(("trim_qbar",) if coefficient else ()))),
        loads.outputs,
        (*loads.parameters, *biases),
        equations,
        own=(*loads.biases, *biases),
    )


FORM = Form("short period", ("Z", "M"), (*COEFFICIENT, *DIMENSIONAL), ("alpha", "w", "q", "az"), build)
