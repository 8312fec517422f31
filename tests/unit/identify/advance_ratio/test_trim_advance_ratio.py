"""Advance ratios of records made by hand, and what is said where there is none."""

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle
from freqid.identify.advance_ratio.trim import excited, flown_trim, trim_advance_ratio

TIME = np.arange(0, 10, 0.02)


def maneuver(speeds, diameter=0.23, logged=True, airspeed=15.0):
    rotors = tuple(Rotor(name=f"n{i}", spin=1, inertia=0.0, diameter_m=diameter) for i in range(len(speeds)))
    vehicle = Vehicle(
        name="blown",
        mass_properties=MassProperties(mass_kg=6.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5)),
        effectors=tuple(Effector(name=r.name, kind="rotor", limits=(0.0, 2000.0)) for r in rotors),
        rotors=rotors,
    )
    channels = {"air/V": airspeed + np.sin(2 * np.pi * TIME)}
    channels |= {"air/alpha": 0.1 + 0 * TIME, "air/beta": 0 * TIME}
    channels |= {f"effector/n{i}": s + 0 * TIME for i, s in enumerate(speeds) if logged}
    channels |= {"excitation/de": np.where((TIME > 2) & (TIME < 8), np.sin(7 * TIME), 0.0)}
    units = {"V": "m/s", "alpha": "rad", "beta": "rad", "de": "rad"}
    record = FlightRecord(
        TIME,
        {n: Channel(n, units.get(n.split("/")[1], "rad/s"), v, 50.0, "made") for n, v in channels.items()},
    )
    return Maneuver(record, vehicle)


def test_the_advance_ratio_is_airspeed_over_tip_travel():
    """15 m/s with 100 turns a second of 0.23 m."""
    assert trim_advance_ratio(maneuver([200 * np.pi] * 2)) == pytest.approx(15 / 100 / 0.23, rel=0.01)


@pytest.mark.parametrize("speed", [0.0, -0.4, 0.3])
def test_stopped_propellers_are_infinite(speed):
    assert trim_advance_ratio(maneuver([speed] * 3)) == np.inf
    trim, why = flown_trim([maneuver([speed]), maneuver([speed])])
    assert trim["advance_ratio"] == np.inf
    assert not why


def test_several_manoeuvres_share_a_trim():
    trim, why = flown_trim([maneuver([600.0]), maneuver([700.0], airspeed=17.0)])
    assert not why
    assert trim["V"] == pytest.approx(16.0, rel=0.02)
    assert 1 / trim["advance_ratio"] == pytest.approx(0.23 / (4 * np.pi) * (600 / 15 + 700 / 17), rel=0.02)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (maneuver([]), "vehicle 'blown' describes no propeller"),
        (maneuver([600.0], diameter=None), "rotor 'n0' of vehicle 'blown' states no diameter"),
        (maneuver([600.0], logged=False), "channel 'effector/n0' is missing"),
    ],
)
def test_what_is_missing_is_one_sentence(changed, message):
    with pytest.raises(DataError, match=message):
        trim_advance_ratio(changed)
    trim, why = flown_trim([changed])
    assert message in why
    assert set(trim) == {"V", "alpha"}


def test_the_excited_part_is_cut():
    cut = excited(maneuver([600.0]).record)
    assert cut.time[0] == pytest.approx(2.02)
    assert cut.time[-1] == pytest.approx(7.98)


def test_hover_has_an_advance_ratio_of_zero():
    still = maneuver([600.0], airspeed=0.0)
    still.record["air/V"][:] = 0.0
    assert trim_advance_ratio(still) == 0.0
    trim, why = flown_trim([still])
    assert trim["advance_ratio"] == 0.0
    assert not why


def test_where_nothing_moves_there_is_none():
    still = maneuver([0.0], airspeed=0.0)
    still.record["air/V"][:] = 0.0
    trim, why = flown_trim([still])
    assert "advance_ratio" not in trim
    assert "neither the vehicle nor a propeller moves" in why


def test_a_signed_speed_is_refused():
    with pytest.raises(DataError, match="'effector/n1' is negative in the mean"):
        trim_advance_ratio(maneuver([600.0, -600.0]))
