"""Errors of a flight's sensors, before anything is modelled: found by kinematics, or by alignment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.blas import on_one_thread
from freqid.core.channels import FLOW, VELOCITY
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.core.sections.estimators import EstimatorName
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification
from freqid.identify import point
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.model.widening import with_covariance
from freqid.identify.point import lines_of
from freqid.identify.sensors import alignment, kinematics
from freqid.identify.sensors.air_data_lag import LagByLoads, lag_by_loads
from freqid.identify.sensors.alignment import Alignment
from freqid.identify.sensors.kinematics import KinematicCheck, KinematicSettings
from freqid.workflows.inputs import File, Flight, Tell, flight_of, identification_of, maneuver_of, scenario_of

SURE = 3.0  # standard errors from which a sensor error is worth a line
LIKELY = 0.5  # probability from which it is
AIR_NAMES = tuple(f"{n.partition('/')[2]} " for n in (*FLOW, *VELOCITY))


@on_one_thread
def check_sensors(
    flight: Flight, scenario: Scenario | File | None = None, settings: KinematicSettings | None = None
) -> KinematicCheck:
    """Find biases, scale factors and delays of sensors from what kinematics ties together.

    Parameters
    ----------
    flight : FlightRecord, Maneuver or path
        With ``p q r ax ay az`` and any of airspeed, flow angles, ``u v w``, attitude, altitude and velocity
        over ground.
    scenario : Scenario, path or name, optional
        Describes the vehicle of a record that does not. With its ``[identification]``, and injected signals
        in the record, scales and delays of the air data are told by what these signals move, in gusts too.
    settings : KinematicSettings, optional
        Which errors are estimated, and how large they may well be.

    Returns
    -------
    KinematicCheck
        ``check["ax bias"]`` is an estimate with its standard error, SI.

    Raises
    ------
    DataError
        Where channels are missing, the record is too short or the estimates do not settle.
    UsageError
        Where an error is asked for that the record's channels do not have.

    Notes
    -----
    Output error (Klein & Morelli, 2nd ed., ch. 10; docs/theory/kinematics.md).

    Examples
    --------
    >>> check = check_sensors("flight.h5")  # doctest: +SKIP
    >>> check["alpha delay"]  # doctest: +SKIP
    (0.041, 0.003)
    """
    flown = flight_of(flight)
    if scenario is not None:
        described = scenario_of(scenario)
        flown = maneuver_of(flight, described)
        there = described.at(flown.record.reference)
        driven, lag = _driven([flown], described.identification, there.excitation)[0]
        return kinematics.check_kinematics(flown, settings or KinematicSettings(), driven, lag)
    return kinematics.check_kinematics(flown, settings or KinematicSettings())


@on_one_thread
def correct_sensors(flight: Flight, check: KinematicCheck) -> FlightRecord | Maneuver:
    """Return a flight without the sensor errors that a check found.

    Parameters
    ----------
    flight : FlightRecord, Maneuver or path
        The one that was checked, or another flown with the same sensors.
    check : KinematicCheck
        Of `check_sensors`.

    Returns
    -------
    FlightRecord or Maneuver
        Of the kind that was given; cut to the time that all corrected channels cover. Its provenance lists
        the corrections.

    Raises
    ------
    DataError
        Where the file is no intact record.

    Examples
    --------
    >>> flight = correct_sensors("flight.h5", check_sensors("flight.h5"))  # doctest: +SKIP
    """
    return kinematics.corrected(flight_of(flight), check)


@on_one_thread
def align_sensors(flight: Flight, scenario: Scenario | File) -> tuple[Maneuver, Alignment]:
    """Find how late each group of sensors is, biases of attitude and a steady wind, and take them out.

    Parameters
    ----------
    flight : FlightRecord, Maneuver or path
    scenario : Scenario, path or name
        Its ``[identification]`` gives responses, regressors and lines.

    Returns
    -------
    maneuver : Maneuver
        On the clock of the inertial sensors; with ``u v w`` through the fitted wind, where only velocity over
        the ground was logged.
    alignment : Alignment
        ``alignment["surface delay"]`` is an estimate with its standard error, s.

    Raises
    ------
    DataError
        Where nothing can be aligned.
    UsageError
        Where the scenario names neither lines nor an excitation.

    Examples
    --------
    >>> maneuver, alignment = align_sensors("flight.h5", "la8")  # doctest: +SKIP
    """
    described = scenario_of(scenario)
    settings = identification_of(described)
    maneuver = maneuver_of(flight, described)
    excitation = described.at(maneuver.record.reference).excitation
    return alignment.align(maneuver, settings, lines_of(settings, excitation))


Progress = Callable[[int, int], None]
"""Told how many steps of how many are done."""


def unwatched(done: int, total: int) -> None:
    """Show no progress."""


@dataclass(frozen=True)
class Checked:
    """Manoeuvres whose sensors were checked.

    Attributes
    ----------
    flown : sequence of Maneuver
        As they were.
    used : list of Maneuver
        Corrected, where that was asked for.
    checks : list of KinematicCheck
    corrected : bool
    account : dict
        By name: what was found, for the provenance of a model.
    """

    flown: Sequence[Maneuver]
    used: list[Maneuver]
    checks: list[KinematicCheck]
    corrected: bool
    account: dict[str, Any]


def checked(
    maneuvers: Sequence[Maneuver],
    names: Sequence[str],
    *,
    settings: Identification,
    excitation: Excitation | None,
    correct: bool,
    tell: Tell,
    progress: Progress = unwatched,
) -> Checked:
    """Check manoeuvres, tell what is found, and return them, corrected where asked.

    Returns
    -------
    Checked

    Raises
    ------
    DataError
        Where a record lacks the channels that kinematics tie together.
    """
    used, checks, account = [], [], {}
    progress(0, len(maneuvers))
    driven = _driven(maneuvers, settings, excitation)
    for done, (maneuver, name, by) in enumerate(zip(maneuvers, names, driven, strict=True), start=1):
        try:
            check = kinematics.check_kinematics(maneuver, driven=by[0], lag=by[1])
            used.append(kinematics.corrected(maneuver, check) if correct else maneuver)
        except DataError as error:
            raise error.at(name) from None
        _tell_errors(name, check, tell, corrected=correct)
        checks.append(check)
        account[name] = {
            "corrected": correct,
            "errors": check.account(),
            "undetermined": {n: list(others) for n, others in check.undetermined.items()},
            "gusts": {"std": check.gusts.std, "lower": check.gusts.lower, "upper": check.gusts.upper},
            "told_by": "injected signals" if check.instruments else "all motion",
        }
        progress(done, len(maneuvers))
    return Checked(maneuvers, used, checks, correct, account)


def _driven(
    maneuvers: Sequence[Maneuver], settings: Identification | None, excitation: Excitation | None
) -> Sequence[tuple[FlightRecord, LagByLoads] | tuple[None, None]]:
    """Return what the injected signals alone would have made of each, and how late its air data are by loads.

    None where that cannot be had.
    """
    try:
        if settings is None:
            return [(None, None)] * len(maneuvers)
        lines = lines_of(settings, excitation)
        # A loop that is modelled with late air data is another one, of which instruments are weak.
        lags = [lag_by_loads(m, lines, settings) for m in maneuvers]
        driven = driven_maneuvers([lag.on_time for lag in lags], lines, settings)
        return [(m.record, lag) for m, lag in zip(driven, lags, strict=True)]
    except (UsageError, DataError):  # no injected signals, no lines, or channels that a loop needs missing
        return [(None, None)] * len(maneuvers)


def _tell_errors(name: str, check: KinematicCheck, tell: Tell, *, corrected: bool) -> None:
    """Tell the sensor errors that are likely, what is taken out for them, and what the data do not tell."""
    tell(f"{name}: sensor errors by kinematics" + (", corrected" if corrected else ""))
    for parameter, unit in zip(check.names, check.units, strict=True):
        value, sigma = check[parameter]
        chance = check.probability.get(parameter)
        if abs(value) > SURE * sigma or (chance or 0.0) > LIKELY:
            text = f"  {parameter:16s}{value:11.4g} +- {sigma:.2g} {'' if unit == '1' else unit}"
            if corrected and chance is not None:
                out, doubt = check.correction[parameter]
                text += ", by the loads" if parameter in check.by_loads else ""
                text += f", there with probability {chance:.2g}; taken out {out:.4g} +- {doubt:.2g}"
            tell(text)
    if any(n.startswith(AIR_NAMES) for n in check.names):
        gusts = check.gusts
        calm = "none beyond doubt" if not gusts.lower else f"{gusts.lower:.2g} to {gusts.upper:.2g}"
        tell(f"  gusts {gusts.std:.2g} m/s (95 %: {calm})")
        if not check.instruments:
            tell(
                "  no injected signals tell the aircraft's own motion from the gusts that it rides: scales "
                "and delays of the air data are the less certain"
            )
    if check.undetermined:
        tell(f"  not told by these data, and left as they are: {', '.join(check.undetermined)}")


def with_correction_doubt(
    model: PointModel,
    checked: Checked,
    identify: Callable[[Sequence[Maneuver], Identification], PointModel],
    settings: Identification,
    *,
    aligned: bool,
    progress: Progress = unwatched,
) -> PointModel:
    """Return a model of corrected manoeuvres whose covariances hold what is uncertain in the corrections.

    Parameters
    ----------
    model : PointModel
        Of ``checked.used``.
    checked : Checked
    identify : callable
        Manoeuvres and settings to a model, as `model` was made.
    settings : Identification
    aligned : bool
        The model needs the attitude's clock and that of the ground too.
    progress : callable

    Returns
    -------
    PointModel

    Notes
    -----
    ``J C J^T`` with C the covariance of the air data's errors that were taken out, the doubt whether they
    are there among it, and J the change of the estimates by each, from identifying again with the correction
    moved by one standard error. The terms are those of `model`. Delays and scales that the checks do not tell
    are named in a remark: nothing holds them.
    """
    fixed = msgspec.structs.replace(
        settings,
        regressors={r: model[r].regressors for r in settings.responses},
        structure="given",
        nonlinear="none",
    )
    jobs = [
        (m, n)
        for m, check in enumerate(checked.checks)
        for n in check.probability
        if n.startswith(AIR_NAMES) or (aligned and n.endswith(("delay", "scale")))
    ]
    changes: dict[str, list[Array]] = {r: [] for r in settings.responses}
    progress(0, len(jobs))
    for done, (m, name) in enumerate(jobs, start=1):
        check, moved = checked.checks[m], list(checked.used)
        value, doubt = check.correction[name]
        errors = {**check.correction.errors, name: value + doubt}
        moved[m] = kinematics.without_errors(checked.flown[m], errors, check.computed)
        there = identify(moved, fixed)
        for r in settings.responses:
            changes[r].append(there[r].estimate - model[r].estimate)
        progress(done, len(jobs))
    model = replace(model, remarks=(*model.remarks, *_not_held(checked)))
    if not jobs:
        return model
    correlation = np.eye(len(jobs))
    for i, (m, name) in enumerate(jobs):
        for j, (k, other) in enumerate(jobs):
            if m == k:
                of = checked.checks[m].correction
                a, b = of.names.index(name), of.names.index(other)
                correlation[i, j] = of.covariance[a, b] / (of.std_error[a] * of.std_error[b])
    responses = dict(model.responses)
    for r, rows in changes.items():
        by = np.array(rows)
        responses[r] = with_covariance(model[r], model[r].covariance + by.T @ correlation @ by)
    return replace(model, responses=responses)


def _not_held(checked: Checked) -> tuple[str, ...]:
    """Return the remark on delays and scales of the air data that may be there unseen."""
    names = {
        n: None
        for check in checked.checks
        for n in check.undetermined
        if n.startswith(AIR_NAMES) and n.endswith(("delay", "scale"))
    }
    if not names:
        return ()
    return (
        f"The flights do not tell {', '.join(names)}: taken as zero, and no interval holds what they may do.",
    )


def identified(
    align_by: str,
    maneuvers: Sequence[Maneuver],
    names: Sequence[str],
    settings: Identification,
    *,
    excitation: Excitation | None,
    reference: Reference | None,
    estimator: EstimatorName | None,
    tell: Tell,
) -> tuple[PointModel, dict[str, Any]]:
    """Identify manoeuvres, aligned first where `align_by` is ``"fit"``, and tell what was found.

    With ``"report"`` what alignment would find is told, and the records are used as they are.
    """
    named = {"excitation": excitation, "reference": reference}
    found: tuple[Alignment, ...] = ()
    if align_by == "fit":
        model, found = alignment.identify_aligned(maneuvers, settings, **named, estimator=estimator)
    else:
        if align_by == "report":
            lines_hz = lines_of(settings, excitation)
            found = tuple(alignment.align(m, settings, lines_hz)[1] for m in maneuvers)
        model = None
    for name, one in zip(names, found, strict=False):
        _tell_alignment(name, one, tell, taken_out=align_by == "fit")
    if model is None:
        model = point.identify_point(maneuvers, settings, **named, estimator=estimator)
    return model, {name: a.account() for name, a in zip(names, found, strict=False)}


def _tell_alignment(name: str, found: Alignment, tell: Tell, *, taken_out: bool) -> None:
    """Tell delays, attitude's biases and the wind, each with its standard error."""
    tell(f"{name}: sensors aligned" if taken_out else f"{name}: alignment would find")
    for unknown, unit in zip(found.names, found.units, strict=True):
        value, sigma = found[unknown]
        note = " (not told by these data)" if unknown in found.unobservable else ""
        unit = "" if unit == "1" else f" {unit}"
        tell(f"  {unknown:16s}{value:11.4g} +- {sigma:.2g}{unit}{note}")
