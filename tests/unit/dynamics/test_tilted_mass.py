import msgspec
import numpy as np
import pytest
import tilt_wing

from freqid.core.vehicle import Wing
from freqid.dynamics.mass import with_tilted_wings


def test_mass_moves_with_the_wings():
    wing = tilt_wing.VEHICLE.wings[0]
    heavy = Wing(name=wing.name, tilt=wing.tilt, pivot_m=(0.6, 0, 0), mass_kg=5.0, cg_m=(0.8, 0, 0))
    vehicle = msgspec.structs.replace(tilt_wing.VEHICLE, wings=(heavy, *tilt_wing.VEHICLE.wings[1:]))
    stated = vehicle.mass_properties
    moved = with_tilted_wings(vehicle, {wing.tilt: np.pi / 2})
    # the wing's mass goes from 0.2 m ahead of its pivot to 0.2 m above it
    shift = 5.0 / stated.mass_kg * np.array([-0.2, 0.0, -0.2])
    np.testing.assert_allclose(np.subtract(moved.mass_properties.cg_m, stated.cg_m), shift, atol=1e-12)
    place = np.array([0.8, 0.0, 0.0]) - stated.cg_m, np.array([0.6, 0.0, -0.2]) - moved.mass_properties.cg_m
    # parallel axes, by hand: the rest stays where it is
    rest = stated.mass_kg - 5.0
    centre = (stated.mass_kg * np.array(stated.cg_m) - 5.0 * np.array([0.8, 0, 0])) / rest
    before, after = (centre - stated.cg_m, centre - moved.mass_properties.cg_m)

    def about(mass, d):
        return mass * (d @ d * np.eye(3) - np.outer(d, d))

    right = stated.inertia.matrix - about(5.0, place[0]) - about(rest, before)
    right = right + about(5.0, place[1]) + about(rest, after)
    np.testing.assert_allclose(moved.mass_properties.inertia.matrix, right, atol=1e-12)
    assert with_tilted_wings(moved, {wing.tilt: 0.0}).mass_properties.cg_m == pytest.approx(stated.cg_m)
