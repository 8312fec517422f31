"""What a vehicle truly did, as a record: the input of the sensors, and a file that only tests may read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH, si_unit
from freqid.core.record import Channel, FlightRecord, read_record, write_record
from freqid.core.scenario import Scenario
from freqid.dynamics.frames import flow_angles
from freqid.simulate.fly import DT, EVERY, Flight
from freqid.simulate.motion.actuators import Commands, by_kind

FORMAT = "freqid-truth"


def truth_of(
    scenario: Scenario, flight: Flight, *, excited: tuple[str, ...], reference: str
) -> tuple[FlightRecord, Array]:
    """Return the truth of a flight.

    Parameters
    ----------
    scenario : Scenario
    flight : Flight
    excited : tuple of str
        Effectors whose excitation is recorded.
    reference : str
        Id of the reference condition.

    Returns
    -------
    truth : FlightRecord
        Motion relative to the air, specific force of the vehicle's origin, angular accelerations,
        effectors, commands, excitations, power, and the applied wrench about the centre of gravity.
    wind : ndarray, shape (3, sample)
        Velocity of the air over the ground, body axes, m/s.
    """
    samples, vehicle = flight.samples, scenario.aircraft()
    moving, details = samples.moving, samples.details
    body, flow = moving.body, details.flow
    velocity = np.asarray(flow.velocity).T
    speed, alpha, beta = flow_angles(velocity)
    values: dict[str, Array] = {}

    def add(group: str, names: str, rows: ArrayLike) -> None:
        values.update(zip((f"{group}/{name}" for name in names.split()), np.asarray(rows), strict=True))

    add("state", "u v w", velocity)
    add("state", "p q r", body.rates.T)
    add("state", "phi theta psi", samples.angles.T)
    add("state", "ax ay az", samples.felt.T)
    add("state", "pdot qdot rdot", samples.rate.body.rates.T)
    add("state", "alt", -body.position[:, 2:].T)
    add("air", "rho V alpha beta qbar", np.stack([flow.rho, speed, alpha, beta, flow.rho * speed**2 / 2]))
    add("power", "voltage current", np.stack(details.power))
    add("response", " ".join(WRENCH), samples.wrench.T)
    positions = Commands(details.positions.surface, details.positions.tilt, details.positions.speed)
    for group, found in (
        ("effector", positions),
        ("command", samples.commands),
        ("excitation", flight.excitation),
    ):
        for name, row in _by_name(scenario, found).items():
            if group != "excitation" or name in excited:
                values[f"{group}/{name}"] = row

    rate = 1 / (DT * EVERY)
    channels = {}
    for name, row in values.items():
        unit = si_unit(name, vehicle.effector_kinds) or ""
        channels[name] = Channel(name, unit, np.asarray(row, dtype=float), rate, "simulated", (0.0, 0.0, 0.0))
    wind = np.asarray(body.velocity).T - velocity
    record = FlightRecord(time=flight.time, channels=channels, vehicle=vehicle, reference=reference)
    return record, wind


def _by_name(scenario: Scenario, found: Commands) -> dict[str, Array]:
    """Return samples of every effector by its name, in the scenario's order."""
    effectors = scenario.aircraft().effectors
    places = by_kind(scenario.aircraft(), np.arange(len(effectors)))
    rows: dict[int, Array] = {}
    for columns, of_kind in zip(found, places, strict=True):
        rows |= {int(place): np.asarray(columns)[:, i] for i, place in enumerate(of_kind)}
    return {effector.name: rows[i] for i, effector in enumerate(effectors)}


def truth_path(record: Path) -> Path:
    """Return where the truth of a record is kept."""
    return record.with_suffix(".truth.h5")


def write_truth(path: Path, truth: FlightRecord, scenario_sha256: str = "") -> None:
    """Write a truth, whole or not at all, in a format of its own that no other command reads."""
    write_record(path, truth, scenario_sha256, kind=FORMAT)


def read_truth(path: Path) -> FlightRecord:
    """Read a truth.

    Raises
    ------
    DataError
        Where the file is no intact truth.
    """
    return read_record(path, kind=FORMAT)
