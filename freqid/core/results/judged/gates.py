"""Gates of a scenario that a point model misses, or that nothing was given to judge by."""

from __future__ import annotations

import math
from dataclasses import dataclass

from freqid.core.results.point import PointModel
from freqid.core.scenario import Gates


@dataclass(frozen=True)
class MissedGate:
    """A figure of merit that is not what the scenario asks for.

    Attributes
    ----------
    response : str
    figure : str
        ``"R2"``, ``"condition number"``, ``"variance inflation"``, ``"coherence"``, ``"validation error"`` or
        ``"consistency"``.
    value, gate : float
    why : str
        What it comes from, in a few words, where that is known.
    """

    response: str
    figure: str
    value: float
    gate: float
    why: str = ""

    @property
    def unjudged(self) -> bool:
        """Whether the gate is on a manoeuvre that was not used, and none was given."""
        return self.figure == "validation error" and math.isnan(self.value)

    def __str__(self) -> str:
        said = f"{self.figure} of {self.response} is {self.value:.5g}"
        return f"{said}{f', because {self.why}' if self.why else ''}, the gate is {self.gate:g}"


def unjudged_gates(model: PointModel, gates: Gates) -> str:
    """Return one sentence on gates that nothing was given to judge by; empty where there are none."""
    left = [miss.response for miss in missed_gates(model, gates) if miss.unjudged]
    if not left:
        return ""
    return (
        f"the gate on validation of {', '.join(left)} is not judged: no manoeuvre that was not used was "
        "predicted (--predict)"
    )


def missed_gates(model: PointModel, gates: Gates) -> list[MissedGate]:
    """Return the gates that a model misses; a figure that is not a number misses its gate."""
    missed = []
    for name, response in model.responses.items():
        asked = gates.r2.get(name) if isinstance(gates.r2, dict) else gates.r2
        if asked is not None and not response.r2 >= asked:
            missed.append(MissedGate(name, "R2", response.r2, asked))
        bound = gates.condition_number
        if bound is not None and not response.condition_number <= bound:
            missed.append(MissedGate(name, "condition number", response.condition_number, bound))
        pair = response.most_collinear
        if gates.collinearity is not None and pair and not pair.inflation <= gates.collinearity:
            one, other = pair.regressors
            why = (
                f"'{one}' and '{other}' moved together (their parameters' errors are correlated by "
                f"{pair.correlation:.3f})"
            )
            missed.append(MissedGate(name, "variance inflation", pair.inflation, gates.collinearity, why))
        if gates.coherence is not None:
            lines = response.fit.get("frequency")
            value = lines.coherence if lines is not None else float("nan")
            if not value >= gates.coherence:
                missed.append(MissedGate(name, "coherence", value, gates.coherence))
        asked = gates.validation.get(name) if isinstance(gates.validation, dict) else gates.validation
        if asked is not None and not (error := validation_error(model, name)) <= asked:
            missed.append(MissedGate(name, "validation error", error, asked))
    return missed


def gate_sentences(model: PointModel, gates: Gates) -> list[str]:
    """Return a sentence for each gate that a model misses; one for all that nothing was given to judge by."""
    missed = [str(miss) for miss in missed_gates(model, gates) if not miss.unjudged]
    return [*missed, *filter(None, [unjudged_gates(model, gates)])]


def validation_error(model: PointModel, response: str) -> float:
    """Return Theil's coefficient on the manoeuvre that a model was not made from; nan where there is none."""
    fit, lines = model.prediction.get(response), model[response].fit.get("frequency")
    if fit is None:
        return float("nan")
    return fit.inside(float(lines.axis[-1]) if lines is not None else float("inf")).theil
