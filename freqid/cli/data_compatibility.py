"""``identify-point --kinematics``: what a manoeuvre's kinematics say of its sensors, before modelling."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from freqid.core.record import Maneuver
    from freqid.identify.kinematics import KinematicCheck

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
    from freqid.identify.kinematic_correction import corrected
    from freqid.identify.kinematics import check_kinematics

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
