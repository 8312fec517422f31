"""What is said beside a diagnosis: what records and simulation leave untold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.diagnosis import Which
from freqid.gap.compare import Compared
from freqid.gap.simulation import Simulation


def of_calibration(which: Which, why: str) -> list[str]:
    """Return why probabilities are not calibrated; nothing where they are."""
    if which.calibrated:
        return []
    return [f"the probabilities are not calibrated here: {why}; --self-test calibrates them on these flights"]


def of_records(used: Sequence[Compared], simulation: Simulation) -> list[str]:
    """Return what records and simulation leave untold."""
    said = []
    if not any(c.lines.inputs for c in used):
        said.append(
            "the records hold no injected signals: where a gap lies by input cannot be told, and feedback "
            "may make one effect look like another"
        )
    silent = {row.name for c in used for row in c.rows if row.kind == "kinematic"}
    if not silent:
        said.append(
            "without velocities, specific forces and attitude, faults of the sensors cannot be told apart"
        )
    if all(not c.trial.positions and "actuator_delay" in c.not_tested for c in used):
        said.append(
            f"{simulation.name} has no actuators: what happens between command and position is not tested"
        )
    loud = [
        c.rows[i].name
        for c in used
        for i in range(len(c.rows))
        if c.rows[i].kind == "response" and np.median(c.noise.sensor_share[i]) < 0.25
    ]
    if loud:
        told = ", ".join(dict.fromkeys(loud))
        said.append(
            f"in {told} most noise is not the sensors': turbulence, vibration or a strongly nonlinear gap"
        )
    return said
