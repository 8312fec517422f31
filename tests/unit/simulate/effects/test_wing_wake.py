"""Which wings stand in the wake of which."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Inertia, MassProperties, Vehicle, Wing
from freqid.simulate.effects import library

TIME = 0.02 * np.arange(201)


def added(*places, plunge=0.5):
    """Return what a wake adds, shape (6, sample), to wings of one tilt each with pivots at places x, y."""
    wings = tuple(Wing(f"w{i}", f"t{i}", (x, y, 0.0)) for i, (x, y) in enumerate(places))
    body = MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5))
    vehicle = Vehicle("wings", body, area_m2=1.0, wings=wings)
    rows = {"u": 20.0, "v": 0.0, "w": plunge * np.sin(2 * np.pi * TIME), "p": 0.0, "q": 0.0, "r": 0.0}
    channels = {f"state/{n}": x for n, x in rows.items()} | {"air/rho": 1.225}
    channels |= {f"effector/{w.tilt}": 0.0 for w in wings}
    record = FlightRecord(TIME, {n: Channel(n, "1", x + 0 * TIME, 50.0, "test") for n, x in channels.items()})
    return library()["wing_wake"].replay({"strength": 1.0}, SimpleNamespace(record=record, vehicle=vehicle))


def test_one_wing_and_wings_side_by_side_have_no_wake_on_them():
    assert not added((0.5, 0.0)).any()
    assert not added((0.5, -1.0), (0.5, 1.0)).any()


def test_a_wing_behind_loses_lift_a_convection_later():
    lift = -added((1.0, 0.0), (-1.0, 0.0))[2]  # of the rear wing, less than without the wake
    assert np.abs(lift).max() > 1.0
    late = np.argmax(np.correlate(-lift[50:], np.sin(2 * np.pi * TIME)[50:], "full")) - (TIME.size - 51)
    assert 0.02 * late == pytest.approx(2.0 / 20.0, abs=0.021)


def test_each_of_four_nacelles_is_behind_the_one_on_its_side():
    """So that nothing rolls or yaws; the order of the wings tells nothing."""
    corners = [(x, y) for x in (1.0, -1.0) for y in (-1.0, 1.0)]
    four, shuffled = added(*corners), added(*(corners[i] for i in (3, 0, 2, 1)))
    np.testing.assert_allclose(four, shuffled, atol=1e-9)
    np.testing.assert_allclose(four[[1, 3, 5]], 0.0, atol=1e-9)
    assert np.abs(four[4]).max() > 1.0
