"""``identify-point --kinematics`` and ``--align``: errors of a record's sensors, before modelling."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from freqid.core.excitation import Excitation
    from freqid.core.identification import Identification
    from freqid.core.record import Maneuver
    from freqid.core.results.point import PointModel
    from freqid.core.scenario import Reference
    from freqid.identify.point import Estimator
    from freqid.identify.sensors.alignment import Alignment
    from freqid.identify.sensors.kinematics import KinematicCheck

SURE = 3.0  # standard errors from which a sensor error is worth a line


def checked(
    maneuvers: list[Maneuver], records: list[Path], *, correct: bool
) -> tuple[list[Maneuver], dict[str, Any]]:
    """Check manoeuvres, tell what is found on stderr, and return them, corrected where asked.

    Raises
    ------
    DataError
        Where a record lacks the channels that kinematics tie together.
    """
    from freqid.core.errors import DataError
    from freqid.identify.sensors.kinematics import check_kinematics, corrected

    kept, account = [], {}
    for maneuver, record in zip(maneuvers, records, strict=True):
        try:
            check = check_kinematics(maneuver)
            kept.append(corrected(maneuver, check) if correct else maneuver)
        except DataError as error:
            raise error.at(str(record)) from None
        _tell(record, check, corrected=correct)
        account[str(record)] = {
            "corrected": correct,
            "errors": {
                name: {"estimate": float(value), "std_error": float(sigma), "units": unit}
                for name, value, sigma, unit in zip(
                    check.names, check.estimate, check.std_error, check.units, strict=True
                )
            },
            "undetermined": {name: list(others) for name, others in check.undetermined.items()},
        }
    return kept, account


def _tell(record: Path, check: KinematicCheck, *, corrected: bool) -> None:
    """Print the sensor errors that are beyond doubt, and those that the data do not tell."""
    click.echo(f"{record}: sensor errors by kinematics" + (", corrected" if corrected else ""), err=True)
    for name in check.names:
        value, sigma = check[name]
        if abs(value) > SURE * sigma:
            unit = check.units[check.names.index(name)]
            click.echo(f"  {name:16s}{value:11.4g} +- {sigma:.2g} {'' if unit == '1' else unit}", err=True)
    if check.undetermined:
        click.echo(f"  not told by these data: {', '.join(check.undetermined)}", err=True)


def identified(
    align_by: str,
    maneuvers: list[Maneuver],
    records: list[Path],
    settings: Identification,
    *,
    excitation: Excitation | None,
    reference: Reference | None,
    estimator: Estimator | None,
) -> tuple[PointModel, dict[str, Any]]:
    """Identify manoeuvres, aligned first where `align_by` is ``"fit"``, and tell what was found on stderr.

    With ``"report"`` what alignment would find is told, and the records are used as they are.
    """
    from freqid.identify.point import identify_point, lines_of
    from freqid.identify.sensors.alignment import align, identify_aligned

    named = {"excitation": excitation, "reference": reference}
    if align_by == "fit":
        model, found = identify_aligned(maneuvers, settings, **named, estimator=estimator)
    else:
        lines_hz = lines_of(settings, excitation) if align_by == "report" else None
        found = () if lines_hz is None else tuple(align(m, settings, lines_hz)[1] for m in maneuvers)
        for record, alignment in zip(records, found, strict=False):
            _tell_alignment(record, alignment, taken_out=False)
        return identify_point(maneuvers, settings, **named, estimator=estimator), _account(records, found)
    for record, alignment in zip(records, found, strict=True):
        _tell_alignment(record, alignment, taken_out=True)
    return model, _account(records, found)


def _account(records: list[Path], found: tuple[Alignment, ...]) -> dict[str, Any]:
    return {str(r): a.account() for r, a in zip(records, found, strict=False)}


def _tell_alignment(record: Path, found: Alignment, *, taken_out: bool) -> None:
    """Print delays, attitude's biases and the wind, each with its standard error."""
    click.echo(f"{record}: sensors aligned" if taken_out else f"{record}: alignment would find", err=True)
    for name, unit in zip(found.names, found.units, strict=True):
        value, sigma = found[name]
        said = " (not told by these data)" if name in found.untold else ""
        unit = "" if unit == "1" else f" {unit}"
        click.echo(f"  {name:16s}{value:11.4g} +- {sigma:.2g}{unit}{said}", err=True)
