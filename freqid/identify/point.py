"""Equation error at one reference condition: from manoeuvres to a point model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import ADVANCE_RATIO, AIR, EFFECTOR_UNITS, STATE
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.scenario import Reference
from freqid.core.sections.estimators import EstimatorName
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import MAXIMUM_LIKELIHOOD, Identification, factors_of
from freqid.identify.advance_ratio.trim import flown_trim
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.loads.explanatory import explanatory_variables, history
from freqid.identify.model.fit import fit_samples
from freqid.identify.model.problem import Problem, measured_responses
from freqid.identify.model.selection import Flights, choose_terms, with_choice
from freqid.identify.regress.estimators import Estimator, find_estimator
from freqid.identify.spectra.fourier import frequency_grid, harmonics
from freqid.identify.spectra.trend import up_to

VELOCITY, FLOW, GROUND = ("u", "v", "w"), ("V", "alpha", "beta"), ("vn", "ve", "vd")
# What each needs of the velocity through the air where it was not logged itself.
_FROM_SPEED = ("qbar", "phat", "qhat", "rhat")


def refuse_without_air(maneuvers: Sequence[Maneuver], settings: Identification, estimator: Estimator) -> None:
    """Refuse, by name, parameters that need a velocity through the air which the records do not hold.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
    settings : Identification
    estimator : Estimator
        Instruments need the whole motion, whatever the regressors are.

    Raises
    ------
    DataError
        Naming the regressors, the responses they belong to, and why.
    """
    for maneuver in maneuvers:
        record = maneuver.record
        wanted: dict[str, list[str]] = {}
        for response in settings.responses:
            for name in dict.fromkeys(f for n in settings.regressors_of(response) for f in factors_of(n)):
                if not _can_be_had(maneuver, name):
                    wanted.setdefault(name, []).append(response)
        if wanted:
            by_responses: dict[tuple[str, ...], list[str]] = {}
            for name, responses in wanted.items():
                by_responses.setdefault(tuple(responses), []).append(name)
            listing = " and ".join(f"{' '.join(n)} of {' '.join(r)}" for r, n in by_responses.items())
            raise DataError(
                f"parameters by {listing} cannot be had: {_why(maneuver)}", remedy=_remedy(record)
            )
        if settings.response_source == "reconstruct":
            for needed, name in (("coefficients", "qbar"), ("stability axes", "alpha")):
                asked = settings.form == "coefficient" if name == "qbar" else settings.axes == "stability"
                if asked and not _can_be_had(maneuver, name):
                    remedy = "ask for form 'force' and body axes, or fly with air data"
                    raise DataError(f"{needed} cannot be had: {_why(maneuver)}", remedy=remedy)
        if estimator.needs_instruments and not _has_relative_wind(record):
            raise DataError(
                f"instruments cannot be had: they are driven through the whole motion, and {_why(maneuver)}",
                remedy=f"use --estimator least-squares, or {_remedy(record)}",
            )


def _can_be_had(maneuver: Maneuver, name: str) -> bool:
    """Tell whether a regressor was logged or can be computed; what is no air quantity is not judged here.

    Airspeed and flow angles of a sensor off the centre of gravity need the whole velocity to get there.
    """
    record = maneuver.record
    if f"state/{name}" in record or (f"air/{name}" in record and not _off_centre(maneuver, name)):
        return True
    if name in (*VELOCITY, *FLOW):
        return _has_relative_wind(record)
    return name not in _FROM_SPEED or _can_be_had(maneuver, "V")


def _off_centre(maneuver: Maneuver, name: str) -> bool:
    """Tell whether a flow sensor is not at the centre of gravity."""
    if name not in FLOW:
        return False
    place = maneuver.record.channel(f"air/{name}").position_m
    return place is not None and tuple(place) != tuple(maneuver.vehicle.mass_properties.cg_m)


def _has_relative_wind(record: FlightRecord) -> bool:
    return all(f"state/{n}" in record for n in VELOCITY) or all(f"air/{n}" in record for n in FLOW)


def _why(maneuver: Maneuver) -> str:
    """Say what is known of the velocity in place of all of it."""
    record = maneuver.record
    logged = [n for g, names in (("state", VELOCITY), ("air", FLOW)) for n in names if f"{g}/{n}" in record]
    part = (
        f"of the air the record holds {' '.join(logged)} alone, not u v w or V alpha beta" if logged else ""
    )
    if all(f"state/{n}" in record for n in GROUND):
        ground = "velocity is known over the ground only (vn ve vd), and the wind is unknown"
        return f"{ground}; {part}" if part else ground
    return part or "the record holds no velocity through the air, neither u v w nor V alpha beta"


def _remedy(record: FlightRecord) -> str:
    ways = ["leave them out of the regressors", "fly with air data"]
    if all(f"state/{n}" in record for n in GROUND):
        ways.insert(0, "find the wind from the flight itself with --align fit")
    return ", or ".join(ways)


# A stated condition that is further off than this changes forces by some per cent, more than a model's
# standard errors. Dynamic pressure goes with the square of speed: 5 % of it are 10 %; a slow flight is
# allowed what air data are usually wrong by.
SPEED_SHARE, LEAST_SPEED = 0.05, 0.5
DENSITY_SHARE = 0.02
TILT = np.radians(2.0)  # turns 3.5 % of a wing's thrust and lift into the other axis


def flown_reference(maneuvers: Sequence[Maneuver], also: Iterable[str] = ()) -> Reference:
    """Return the condition that was flown, from the means of what the records hold; nan where they do not.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
    also : iterable of str
        What a stated condition sets beside the tilts.
    """
    vehicle = maneuvers[0].vehicle
    tilts = [e.name for e in vehicle.effectors if e.kind == "tilt"] or [w.tilt for w in vehicle.wings]
    return Reference(
        id=maneuvers[0].record.reference or "flown",
        u=_mean(maneuvers, "u"),
        rho=_mean(maneuvers, "rho"),
        scheduled={name: _mean(maneuvers, name) for name in dict.fromkeys([*tilts, *also])},
    )


def scheduled_units(maneuvers: Sequence[Maneuver], reference: Reference) -> dict[str, str]:
    """Return the SI unit of what a reference sets beside speed and density, as far as it is known."""
    kinds = maneuvers[0].vehicle.effector_kinds
    units = {name: EFFECTOR_UNITS[kind] for name, kind in kinds.items()}
    units |= {name: unit for name, (unit, _) in {**STATE, **AIR}.items()} | {ADVANCE_RATIO: "1"}
    return {name: units[name] for name in reference.scheduled if name in units}


def departures(
    stated: Reference, flown: Reference, units: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Say where a stated condition is not the one that was flown, one sentence for each quantity.

    Parameters
    ----------
    stated, flown : Reference
        What the flown one does not know, nan, is not compared; a tilt that is not stated is at zero.
    units : mapping of str to str, optional
        Of what is scheduled; rad where a name is absent. Only angles are compared: what counts as far for
        another variable, the corridor says.
    """
    degree = np.degrees(1.0)
    rows = [
        ("forward speed u", "m/s", 1.0, stated.u, flown.u, max(LEAST_SPEED, SPEED_SHARE * abs(stated.u))),
        ("air density rho", "kg/m3", 1.0, stated.rho, flown.rho, DENSITY_SHARE * stated.rho),
    ]
    rows += [
        (f"angle {name}", "deg", degree, stated.scheduled.get(name, 0.0), was, TILT)
        for name, was in flown.scheduled.items()
        if (units or {}).get(name, "rad") == "rad"
    ]
    return tuple(
        f"reference '{stated.id}' states {what} = {factor * said:.4g} {unit}, but the mean flown is "
        f"{factor * was:.4g}, off by {factor * abs(was - said):.3g} where {factor * bound:.2g} is allowed; "
        "the model holds where it was flown."
        for what, unit, factor, said, was, bound in rows
        if abs(was - said) > bound
    )


def _mean(maneuvers: Sequence[Maneuver], name: str) -> float:
    try:
        values = [np.mean(history(m, name)) for m in maneuvers]
    except DataError:
        return float("nan")
    return float(np.average(values, weights=[m.record.duration for m in maneuvers]))


def identify_point(
    maneuver: Maneuver | Sequence[Maneuver],
    settings: Identification,
    *,
    excitation: Excitation | None = None,
    reference: Reference | None = None,
    estimator: EstimatorName | None = None,
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
    if estimator is not None:
        settings = msgspec.structs.replace(settings, estimator=estimator)
    if settings.method in MAXIMUM_LIKELIHOOD:
        raise UsageError(
            f"method '{settings.method}' is no equation error",
            remedy="use identify-point --method, or identify_output_error",
        )
    by = find_estimator(settings.estimator)
    refuse_without_air(maneuvers, settings, by)
    problem = Problem.of(maneuvers, settings)
    alone: Sequence[Maneuver] | None = None
    lines = np.empty(0)
    if settings.method == "frequency" or by.needs_instruments:
        lines = lines_of(settings, excitation)
        for each in maneuvers:
            each.record.check_band(_used(each, problem.names, settings), float(lines[-1]))
    if by.needs_instruments:
        alone = driven_maneuvers(maneuvers, lines, settings)
    flights = Flights(maneuvers, lines, excitation.period_s if excitation else None, alone)
    structure: dict[str, Any] = {}
    before: dict[str, ResponseModel] = {}
    if settings.structure == "stepwise" or settings.nonlinear == "products":
        problem, structure, before = choose_terms(problem, flights)
    if settings.method == "frequency":
        responses = flights.fit(problem)
        responses |= {r: with_choice(responses[r], offered) for r, offered in before.items()}
    else:
        responses = fit_samples(problem, flights.instruments(problem.names))
    flown = flown_reference(maneuvers, reference.scheduled if reference else ())
    units = scheduled_units(maneuvers, reference or flown)
    trim, no_advance_ratio = flown_trim(maneuvers)
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
        estimator=by.name,
        remarks=() if reference is None else departures(reference, flown, units),
        trim=trim,
        no_advance_ratio=no_advance_ratio,
        scheduled_units=units,
        aircraft=maneuvers[0].vehicle,
    )


def predict_responses(model: PointModel, maneuver: Maneuver, settings: Identification) -> dict[str, Fit]:
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
