"""A global model against a manoeuvre that it has not seen."""

from __future__ import annotations

from typing import cast

import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.blend.locate import Outside
from freqid.core.record import Maneuver
from freqid.core.results.fit import Fit
from freqid.identify.loads.explanatory import history
from freqid.identify.loads.wrench import AppliedWrench, Form, applied_wrench
from freqid.identify.spectra.trend import up_to


def replay(
    model: GlobalModel,
    maneuver: Maneuver,
    *,
    measured: AppliedWrench | None = None,
    outside: Outside = "refuse",
) -> dict[str, Fit]:
    """Predict the responses of a manoeuvre from what was flown, trim included.

    Parameters
    ----------
    model : GlobalModel
    maneuver : Maneuver
        Held out; in flight anywhere along the corridor, tilting or not.
    measured : AppliedWrench, optional
        Responses to compare with; reconstructed from motion and mass where absent.
    outside : {"refuse", "hold"}
        As for `GlobalModel.wrench`.

    Returns
    -------
    dict of str to Fit
        Measured and modelled history by response, in the band that the points were identified in.
        Unlike the prediction of a point model both keep their means: a global model says what the trim
        wrench is.

    Raises
    ------
    DataError
        Where the record lacks a channel, or leaves the corridor and that is refused.
    """
    dt = maneuver.record.dt
    if measured is None:
        measured = applied_wrench(maneuver, model.names, form=cast(Form, model.corridor.form))
    modelled = model.wrench(flown(model, maneuver), outside).values
    histories = measured.history(dt)
    if np.isfinite(model.corridor.highest_hz):
        histories, modelled = (up_to(x, dt, model.corridor.highest_hz) for x in (histories, modelled))
    time = maneuver.record.time - maneuver.record.time[0]
    return {
        name: Fit(time, histories[measured.names.index(name)], row)
        for name, row in zip(model.names, modelled, strict=True)
    }


def flown(model: GlobalModel, maneuver: Maneuver) -> dict[str, np.ndarray]:
    """Return the model's inputs from a manoeuvre, shape (sample,) each."""
    return {name: history(maneuver, name) for name in model.inputs}
