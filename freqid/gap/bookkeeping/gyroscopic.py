"""Whether the gyroscopic moments of the rotors are subtracted from the measured moments.

A measured moment is ``I w' + w x I w``, and with spinning rotors of momentum h also ``w x h + h'``. A
simulation whose wrench is aerodynamic and propulsive alone is laid beside the sum; one that has the
gyroscopic moments in its wrench, or never had any, beside the first part. Where the simulation does not say
which it is, the records decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from freqid.core.channels import COEFFICIENT
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.gap.bookkeeping.comparison import Comparison, bench_of
from freqid.gap.simulation import Simulation

_SURE = 3.0  # standard errors from the middle between the two accounts: one decision in 700 is by noise


@dataclass(frozen=True)
class RotorAccount:
    """How the rotors' gyroscopic moments are counted.

    Attributes
    ----------
    vehicle : Vehicle or None
        To be used for the measured moments: with the rotors' inertia, or with none.
    sentence : str
        A remark for the verdict; empty where there is nothing to decide.
    share : float or None
        Of the gyroscopic moments that the records show beside the simulation: one where the simulation
        leaves them to the rigid body, zero where not; None where they were not asked.
    std_error : float or None
    """

    vehicle: Vehicle | None
    sentence: str = ""
    share: float | None = None
    std_error: float | None = None


def rotor_account(
    simulation: Simulation, records: Sequence[FlightRecord], vehicle: Vehicle | None = None
) -> RotorAccount:
    """Decide whether the vehicle's rotors count in the measured moments.

    Parameters
    ----------
    simulation : Simulation
        Its `gyroscopic` decides where it is stated.
    records : sequence of FlightRecord
    vehicle : Vehicle, optional
        In place of the records' and the simulation's.

    Returns
    -------
    RotorAccount

    Raises
    ------
    DataError
        Where records lack what the measured moments are made of, such as a rotor's speed.
    """
    described = vehicle or next((r.vehicle for r in records if r.vehicle), None) or simulation.vehicle
    moments = [n for n in simulation.responses if COEFFICIENT.get(n, n) in ("L", "M", "N")]
    # a recorded moment is what it is; only a reconstructed one is made with the rotors
    made = [n for n in moments if not all(f"response/{n}" in record for record in records)]
    spinning = described is not None and any(rotor.inertia for rotor in described.rotors)
    if described is None or not made or not spinning or simulation.gyroscopic is True:
        return RotorAccount(described)
    without = without_rotor_inertia(described)
    if simulation.gyroscopic is False:
        return RotorAccount(
            without,
            "The rotors' gyroscopic moments are not subtracted from the measured moments: the simulation "
            "states that its wrench does not leave them to the rigid body.",
        )
    share, error = _share(simulation, records, described, without)
    if abs(share - 0.5) < _SURE * error:
        return RotorAccount(
            described,
            "The records do not tell whether the simulation leaves the rotors' gyroscopic moments to the "
            f"rigid body (they show {share:.2f} +- {error:.2f} of them); they are subtracted, as the vehicle "
            "states rotor inertia. State `gyroscopic` on the simulation to decide it.",
            share,
            error,
        )
    if share > 0.5:
        sentence = (
            "The rotors' gyroscopic moments are subtracted from the measured moments: beside the simulation "
            f"the records show {share:.2f} +- {error:.2f} of them."
        )
        return RotorAccount(described, sentence, share, error)
    sentence = (
        "The rotors' gyroscopic moments are not subtracted from the measured moments, although the vehicle "
        f"states rotor inertia: beside the simulation the records show {share:.2f} +- {error:.2f} of them."
    )
    return RotorAccount(without, sentence, share, error)


def as_counted(simulation: Simulation, maneuvers: Sequence[Maneuver]) -> tuple[list[Maneuver], str]:
    """Return manoeuvres whose rotors have inertia where it counts in the measured moments, and the remark.

    Parameters
    ----------
    simulation : Simulation
    maneuvers : sequence of Maneuver
        Of one aircraft.

    Raises
    ------
    DataError
        As `rotor_account`.
    """
    account = rotor_account(simulation, [m.record for m in maneuvers], maneuvers[0].vehicle)
    if account.vehicle is None or any(rotor.inertia for rotor in account.vehicle.rotors):
        return list(maneuvers), account.sentence
    return [replace(m, vehicle=without_rotor_inertia(m.vehicle)) for m in maneuvers], account.sentence


def without_rotor_inertia(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle whose rotors have no polar inertia, so that no gyroscopic moments are made of them."""
    rotors = tuple(msgspec.structs.replace(rotor, inertia=0.0) for rotor in vehicle.rotors)
    return msgspec.structs.replace(vehicle, rotors=rotors)


def _share(
    simulation: Simulation, records: Sequence[FlightRecord], with_rotors: Vehicle, without: Vehicle
) -> tuple[float, float]:
    """Return the share of the gyroscopic moments that fits the records best, and its standard error.

    Least squares of what the simulation predicts more than the measured moments without rotors, on the
    gyroscopic moments, over slow fluctuations of all moments, each over its rms.
    """
    product = size = energy = count = 0.0
    for record in records:
        bare = Comparison(simulation, bench_of(simulation, record, without))
        whole = bench_of(simulation, record, with_rotors)
        rows = [i for i, n in enumerate(bare.bench.names) if COEFFICIENT.get(n, n) in ("L", "M", "N")]
        term = bare.scaled(whole.measured - bare.bench.measured)[rows]
        missing = -bare.residual(bare.predicted)[0][rows]
        product += float((missing * term).sum())
        size += float((term**2).sum())
        energy += float((missing**2).sum())
        count += bare.degrees_of_freedom * len(rows)
    if size < 1e-12:
        return 0.5, np.inf
    share = product / size
    left = max(energy - share * product, 0.0)
    return share, float(np.sqrt(left / max(count - 1, 1) / size))
