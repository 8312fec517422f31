"""An accelerometer that is not where the log says."""

from __future__ import annotations

from collections.abc import Mapping

from freqid.core.channels import FORCES
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import specific_force_at
from freqid.simulate.effects.along import rates, slope
from freqid.simulate.effects.channel_groups import changed
from freqid.simulate.effects.effect import Effect, Parameter

_TURNING = ("state/pdot", "state/qdot", "state/rdot")


def _distort(settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log of an accelerometer further along by the settings, under the stated position.

    ``a + w' x d + w x (w x d)``; the angular acceleration is the log's, or the derivative of the rates.
    """
    arm = [settings[axis] for axis in "xyz"]
    if not any(arm) or not all(name in record for name in FORCES):
        return record
    turning = (
        record.matrix(_TURNING)
        if all(name in record for name in _TURNING)
        else slope(rates(record), record.dt)
    )
    moved = specific_force_at(record.matrix(FORCES), rates(record), turning, arm)
    return changed(record, dict(zip(FORCES, moved, strict=True)))


EFFECT = Effect(
    id="lever_arm",
    stage="sensor",
    meaning="The accelerometer is not where the log has it.",
    parameters={
        "x": Parameter(
            0.0,
            "m",
            "true position forward of the stated one",
            0.05,
            signs=(
                "The accelerometer is farther forward than the log has it",
                "The accelerometer is farther aft than the log has it",
            ),
        ),
        "y": Parameter(
            0.0,
            "m",
            "to the right of it",
            0.05,
            signs=(
                "The accelerometer is farther to the right than the log has it",
                "The accelerometer is farther to the left than the log has it",
            ),
        ),
        "z": Parameter(
            0.0,
            "m",
            "below it",
            0.05,
            signs=(
                "The accelerometer is lower than the log has it",
                "The accelerometer is higher than the log has it",
            ),
        ),
    },
    needs=("state/ax", "state/ay", "state/az", "state/p", "state/q", "state/r"),
    distort=_distort,
)
