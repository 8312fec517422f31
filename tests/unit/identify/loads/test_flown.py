"""The flown condition, and the warning where it is not the stated one."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.scenario import Reference
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle, Wing
from freqid.identify.point import departures, flown_reference


def maneuver(seconds, **levels):
    wings = tuple(Wing(name=n, tilt=t, pivot_m=(0, 0, 0)) for n, t in (("front", "dw1"), ("rear", "dw2")))
    vehicle = Vehicle(
        name="test",
        mass_properties=MassProperties(mass_kg=28.6, inertia=Inertia(xx=3, yy=6, zz=8)),
        wings=wings,
        effectors=tuple(Effector(name=w.tilt, kind="tilt", limits=(-0.1, 1.9)) for w in wings),
    )
    time = np.arange(0.0, seconds + 0.05, 0.1)
    paths = {"u": "state/u", "rho": "air/rho", "dw1": "effector/dw1", "dw2": "effector/dw2"}
    units = {"u": "m/s", "rho": "kg/m3", "dw1": "rad", "dw2": "rad"}
    channels = {
        paths[n]: Channel(paths[n], units[n], np.full(time.size, level) + 0.1 * np.sin(time), 10.0, "test")
        for n, level in levels.items()
    }
    return Maneuver(FlightRecord(time, channels), vehicle)


def test_the_mean_of_several_is_weighted_by_their_length():
    flown = flown_reference([maneuver(20 * np.pi, u=10.0, rho=1.2), maneuver(40 * np.pi, u=13.0, rho=1.2)])
    assert flown.u == pytest.approx(12.0, abs=0.01)
    assert np.isnan(flown["dw1"])


def test_what_agrees_is_not_mentioned():
    stated = Reference.of(id="u45", u=13.72, rho=1.225, dw1=0.384, dw2=0.384)
    assert departures(stated, Reference.of(id="", u=14.3, rho=1.24, dw1=0.40, dw2=float("nan"))) == ()
    hover = Reference(id="u00", u=0.0, rho=1.225)
    assert departures(hover, Reference(id="", u=0.45, rho=1.225)) == ()


@pytest.mark.parametrize(
    ("flown", "says"),
    [
        (
            {"u": 12.5},
            "states forward speed u = 13.72 m/s, but the mean flown is 12.5, off by 1.22 where 0.69",
        ),
        ({"rho": 1.0581}, "states air density rho = 1.225 kg/m3, but the mean flown is 1.058, off by 0.167"),
        (
            {"dw1": 0.45},
            "states angle dw1 = 22 deg, but the mean flown is 25.78, off by 3.78 where 2",
        ),
        (
            {"dw2": 0.3},
            "states angle dw2 = 22 deg, but the mean flown is 17.19, off by 4.81 where 2",
        ),
    ],
)
def test_what_differs_is_said_in_numbers(flown, says):
    stated = {"u": 13.72, "rho": 1.225, "dw1": 0.384, "dw2": 0.384}
    (sentence,) = departures(Reference.of(id="u45", **stated), Reference.of(id="", **(stated | flown)))
    assert says in sentence
