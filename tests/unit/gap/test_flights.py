"""Flights beside a simulation: told apart, of one vehicle, in the band that was driven."""

from dataclasses import dataclass

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.gap.flights import BAND_HZ, differing, injected_band, maneuvers, vehicle_of


@dataclass
class Simulated:
    vehicle: Vehicle | None
    responses: tuple[str, ...] = ("M",)
    name: str = "sim"
    kind: str = "callable"


def vehicle(name="a", mass=10.0, effectors=("de",)):
    made = tuple(Effector(name=n, kind="surface", limits=(-1.0, 1.0)) for n in effectors)
    properties = MassProperties(mass_kg=mass, inertia=Inertia(xx=1, yy=1, zz=1))
    return Vehicle(name=name, mass_properties=properties, effectors=made)


def record(of, scale=1.0, hz=(0.2, 0.9), **more):
    time = np.arange(1001) / 50
    moved = scale * sum(np.sin(2 * np.pi * f * time) for f in hz)
    channels = {
        "state/q": Channel("state/q", "rad/s", moved, 50.0, "made"),
        "effector/de": Channel("effector/de", "rad", moved, 50.0, "made"),
    }
    for name, values in more.items():
        path = name.replace("_", "/", 1)
        channels[path] = Channel(path, "rad", values(time), 50.0, "made")
    return FlightRecord(time, channels, of)


def test_the_same_flight_twice_is_refused_by_name():
    one = record(vehicle())
    with pytest.raises(UsageError, match=r"b\.h5: holds the same flight as a\.h5"):
        maneuvers([one, one], ["a.h5", "b.h5"], Simulated(None))
    assert len(maneuvers([one, record(vehicle(), 2.0)], ["a", "b"], Simulated(None))) == 2


def test_vehicles_that_do_not_match_are_refused():
    flown = record(vehicle())
    with pytest.raises(DataError, match="whose effectors are not those of 'a'"):
        maneuvers([flown, record(vehicle("b", effectors=("de", "dr")), 2.0)], ["x", "y"], Simulated(None))
    with pytest.raises(DataError, match="has no position of dr, which sim of vehicle 'b' needs"):
        maneuvers([flown], ["x"], Simulated(vehicle("b", effectors=("de", "dr"))))


def test_another_name_or_mass_is_remarked():
    found = maneuvers([record(vehicle(mass=12.0))], ["x"], Simulated(None))
    said = differing(found, Simulated(vehicle("b", mass=10.0)))
    assert said[0] == "the records are of vehicle 'a', the simulation of 'b'"
    assert "12 kg, the simulation's 10 kg" in said[1]
    assert differing(found, Simulated(vehicle(mass=12.1))) == []


def test_a_vehicle_is_asked_for_only_where_loads_are_rebuilt_with_it():
    bare = record(None)
    with pytest.raises(DataError, match="nobody describes the vehicle, whose mass and inertia M is rebuilt"):
        vehicle_of([bare], Simulated(None))
    assert vehicle_of([bare], Simulated(None, responses=("q",))) is not None
    its = vehicle("its")
    assert vehicle_of([bare], Simulated(its)) is its
    assert vehicle_of([record(vehicle())], Simulated(its)) is None  # the record's own
    assert vehicle_of([record(vehicle())], Simulated(None), its) is its


def test_the_band_is_what_the_injected_signals_drive():
    injected = record(vehicle(), excitation_de=lambda t: sum(np.sin(2 * np.pi * f * t) for f in (0.25, 1.5)))
    low, high = injected_band([injected])
    assert 0.15 < low <= 0.25
    assert 1.5 <= high < 1.7
    assert injected_band([record(vehicle())]) == BAND_HZ


@pytest.mark.parametrize(("kind", "made"), [("scenario", True), ("callable", False)])
def test_velocities_are_made_of_flow_angles_for_a_scenario_alone(kind, made):
    """Beside another simulation they would be relations between sensors that nobody measured."""
    air = {"air_V": lambda t: 20.0 + 0 * t, "air_alpha": np.sin, "air_beta": lambda t: 0 * t}
    (found,) = maneuvers([record(vehicle(), **air)], ["x"], Simulated(None, kind=kind))
    assert ("state/w" in found.record) == made
    if made:
        assert found.record["state/w"] == pytest.approx(20.0 * np.sin(np.sin(found.record.time)))
