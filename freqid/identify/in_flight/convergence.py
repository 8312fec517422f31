"""How soon a manoeuvre has told what it can: parameters, and the error of their prediction, against time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.in_flight.parameter_history import ParameterHistory
from freqid.identify.loads.explanatory import history
from freqid.identify.model.problem import measured_responses
from freqid.identify.spectra.trend import up_to


def validation_rmse(
    histories: Mapping[str, ParameterHistory],
    held_out: Maneuver,
    settings: Identification,
    highest_hz: float,
) -> dict[str, Array]:
    """Return the error of predicting another manoeuvre with the parameters of each instant.

    Parameters
    ----------
    histories : mapping of str to ParameterHistory
        By response.
    held_out : Maneuver
    settings : Identification
    highest_hz : float
        Of the lines that were regressed; what is above is left out on both sides.

    Returns
    -------
    dict of str to ndarray, shape (k,)
        Root mean square by response, in its unit, about both means.
    """
    dt = held_out.record.dt
    ends = round(2 / highest_hz / dt)  # where what is above the band has not been told apart
    wrench = measured_responses(held_out, settings)
    measured = _varying(wrench.history(dt), dt, highest_hz, ends)
    errors = {}
    for row, name in zip(measured, settings.responses, strict=True):
        found = histories[name]
        moved = _varying(np.array([history(held_out, n) for n in found.regressors]), dt, highest_hz, ends)
        # |z - theta x|^2 from the inner products, so that no prediction is made sample by sample
        cross, square = moved @ row, moved @ moved.T
        energy = row @ row - 2 * found.estimate @ cross
        energy += np.einsum("kp,pq,kq->k", found.estimate, square, found.estimate)
        errors[name] = np.sqrt(np.maximum(energy, 0.0) / row.size)
    return errors


def _varying(values: Array, dt: float, highest_hz: float, ends: int) -> Array:
    """Return rows without their means, their ends and what is above a frequency."""
    values = up_to(values, dt, highest_hz)[:, ends:-ends]
    return values - values.mean(axis=1, keepdims=True)
