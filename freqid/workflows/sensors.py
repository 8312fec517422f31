"""Errors of a flight's sensors, before anything is modelled: found by kinematics, or by alignment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from freqid.core.errors import DataError
from freqid.core.estimators import EstimatorName
from freqid.core.excitation import Excitation
from freqid.core.identification import Identification
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.identify import point
from freqid.identify.point import lines_of
from freqid.identify.sensors import alignment, kinematics
from freqid.identify.sensors.alignment import Alignment
from freqid.identify.sensors.kinematics import KinematicCheck, KinematicSettings
from freqid.workflows.inputs import File, Flight, Tell, flight_of, identification_of, maneuver_of, scenario_of

SURE = 3.0  # standard errors from which a sensor error is worth a line


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
        Describes the vehicle of a record that does not.
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
        flown = maneuver_of(flight, scenario_of(scenario))
    return kinematics.check_kinematics(flown, settings or KinematicSettings())


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


def checked(
    maneuvers: Sequence[Maneuver], names: Sequence[str], *, correct: bool, tell: Tell
) -> tuple[list[Maneuver], dict[str, Any]]:
    """Check manoeuvres, tell what is found, and return them, corrected where asked.

    Returns
    -------
    maneuvers : list of Maneuver
    account : dict
        By name: what was found, for the provenance of a model.

    Raises
    ------
    DataError
        Where a record lacks the channels that kinematics tie together.
    """
    kept, account = [], {}
    for maneuver, name in zip(maneuvers, names, strict=True):
        try:
            check = kinematics.check_kinematics(maneuver)
            kept.append(kinematics.corrected(maneuver, check) if correct else maneuver)
        except DataError as error:
            raise error.at(name) from None
        _tell_errors(name, check, tell, corrected=correct)
        account[name] = {
            "corrected": correct,
            "errors": check.account(),
            "undetermined": {n: list(others) for n, others in check.undetermined.items()},
        }
    return kept, account


def _tell_errors(name: str, check: KinematicCheck, tell: Tell, *, corrected: bool) -> None:
    """Tell the sensor errors that are beyond doubt, and those that the data do not tell."""
    tell(f"{name}: sensor errors by kinematics" + (", corrected" if corrected else ""))
    for parameter in check.names:
        value, sigma = check[parameter]
        if abs(value) > SURE * sigma:
            unit = check.units[check.names.index(parameter)]
            tell(f"  {parameter:16s}{value:11.4g} +- {sigma:.2g} {'' if unit == '1' else unit}")
    if check.undetermined:
        tell(f"  not told by these data: {', '.join(check.undetermined)}")


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
