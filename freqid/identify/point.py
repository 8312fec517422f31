"""Equation error at one reference condition: from manoeuvres to a point model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.excitation import Excitation
from freqid.core.identification import Identification
from freqid.core.record import Maneuver
from freqid.core.results.point import Fit, PointModel
from freqid.core.scenario import Reference
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.loads.air_relative import refuse_without_air
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.loads.flown import departures, flown_reference
from freqid.identify.model.fit_samples import fit_samples
from freqid.identify.model.problem import Problem, measured_responses
from freqid.identify.model.selection import Flights, choose_terms
from freqid.identify.spectra.fourier import frequency_grid, harmonics
from freqid.identify.spectra.trend import up_to

Estimator = Literal["least-squares", "instruments"]
ESTIMATORS = ("least-squares", "instruments")


def identify_point(
    maneuver: Maneuver | Sequence[Maneuver],
    settings: Identification,
    *,
    excitation: Excitation | None = None,
    reference: Reference | None = None,
    estimator: Estimator | None = None,
) -> PointModel:
    """Identify the applied wrench as a linear function of states and effectors about a reference.

    Parameters
    ----------
    maneuver : Maneuver, or a sequence of them
        Several of any lengths, flown at one condition, make one model; each keeps its own bias.
    settings : Identification
        Responses, regressors, lines and method.
    excitation : Excitation, optional
        Gives the lines, its harmonics, where the settings name none.
    reference : Reference, optional
        Condition that the model holds at; the records' means where absent.
    estimator : {"least-squares", "instruments"}, optional
        The settings' where absent. Least squares takes regressors to be free of noise and is biased by
        what they have. Instruments, made from the injected signals in the records, are not; the model then
        holds both.

    Returns
    -------
    PointModel
        Where terms were chosen, its provenance says under ``structure`` which and why
        (`freqid.identify.model.selection.choose_terms`).

    Raises
    ------
    DataError
        Where a channel is missing, constant or collinear, a parameter needs a velocity through the air that
        was not measured, the record does not support the lines, or the
        injected signals do not move a regressor.
    UsageError
        Where no lines are named, or instruments are asked for and no injected signals are recorded.

    Notes
    -----
    Equation error (Klein & Morelli, 2nd ed., ch. 5 and 7). In the frequency domain responses keep
    their derivative part apart and it is differentiated there, so no measured rate ever is
    (docs/theory/identification.md).
    """
    maneuvers = (maneuver,) if isinstance(maneuver, Maneuver) else tuple(maneuver)
    if not maneuvers:
        raise UsageError("no manoeuvre is given", remedy="give at least one")
    estimator = estimator or settings.estimator
    if estimator not in ESTIMATORS:
        raise UsageError(f"estimator '{estimator}' is unknown", remedy=nearest(estimator, ESTIMATORS))
    refuse_without_air(maneuvers, settings, estimator)
    problem = Problem.of(maneuvers, settings)
    by_instruments = estimator == "instruments"
    alone: Sequence[Maneuver] | None = None
    lines = np.empty(0)
    if settings.method == "frequency" or by_instruments:
        lines = lines_of(settings, excitation)
        for each in maneuvers:
            each.record.check_band(_used(each, problem.names, settings), float(lines[-1]))
    if by_instruments:
        alone = driven_maneuvers(maneuvers, lines, settings)
    flights = Flights(maneuvers, lines, excitation.period_s if excitation else None, alone)
    structure: dict[str, Any] = {}
    if settings.structure == "stepwise" or settings.nonlinear == "products":
        problem, structure = choose_terms(problem, flights)
    if settings.method == "frequency":
        responses = flights.fit(problem)
    else:
        responses = fit_samples(problem, flights.instruments(problem.names))
    flown = flown_reference(maneuvers)
    records = [m.record.provenance for m in maneuvers]
    return PointModel(
        reference=reference or flown,
        responses={r: responses[r] for r in settings.responses},
        method=settings.method,
        form=settings.form,
        axes=settings.axes,
        confidence=settings.confidence,
        duration=sum(m.record.duration for m in maneuvers),
        vehicle=maneuvers[0].vehicle.name,
        provenance=({"record": records[0]} if len(records) == 1 else {"records": records})
        | ({"structure": structure} if structure else {}),
        estimator=estimator,
        remarks=() if reference is None else departures(reference, flown),
    )


def predict(model: PointModel, maneuver: Maneuver, settings: Identification) -> dict[str, Fit]:
    """Predict the responses of another manoeuvre, in the time domain.

    Parameters
    ----------
    model : PointModel
    maneuver : Maneuver
        Not used in the identification.
    settings : Identification
        Those of the identification: how responses are had from the record.

    Returns
    -------
    dict of str to Fit
        Measured and predicted history by response, each about its own mean: a point model says how the
        wrench changes about a trim, not what another flight's trim was. Of a model identified on lines
        both are shown up to the highest line.
    """
    wrench = measured_responses(maneuver, settings)
    measured = wrench.history(maneuver.record.dt)
    time = maneuver.record.time - maneuver.record.time[0]
    fits = {}
    for r, name in enumerate(settings.responses):
        response = model[name]
        trim = dict(zip(response.regressors, response.trim.tolist(), strict=True))
        x = explanatory_variables(maneuver, response.regressors, trim)[0]
        both = np.array([measured[r], response.estimate @ x])
        if "frequency" in response.fit:
            both = up_to(both, maneuver.record.dt, float(response.fit["frequency"].axis[-1]))
        both -= both.mean(axis=1, keepdims=True)
        fits[name] = Fit(time, both[0], both[1])
    return fits


def _used(maneuver: Maneuver, names: tuple[str, ...], settings: Identification) -> list[str]:
    """Return the channels that carry the band of the regression: regressors, rates, forces and rotors."""
    wanted = [f"{group}/{name}" for group in ("state", "air", "effector") for name in names]
    if settings.response_source == "reconstruct":
        wanted += [f"state/{n}" for n in ("p", "q", "r", "ax", "ay", "az")]
        wanted += [f"effector/{r.name}" for r in maneuver.vehicle.rotors if r.inertia]
    return [name for name in dict.fromkeys(wanted) if name in maneuver.record]


def lines_of(settings: Identification, excitation: Excitation | None) -> Array:
    """Return the lines of a regression, shape (M,), Hz: those of the settings, or the harmonics.

    Raises
    ------
    UsageError
        Where neither names any.
    """
    if settings.frequencies_hz is None:
        if excitation is None:
            raise UsageError(
                "no frequencies are named",
                remedy="give identification.frequencies_hz, or [excitation] whose harmonics are then used",
            )
        return harmonics(excitation.period_s, excitation.band_hz)
    if isinstance(settings.frequencies_hz, tuple):
        return np.array(settings.frequencies_hz)
    grid = settings.frequencies_hz
    return frequency_grid(grid.start, grid.step, grid.stop)
