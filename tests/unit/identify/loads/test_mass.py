"""Wings that move mass: their part of the wrench, and what a scenario may not say of them."""

import msgspec
import numpy as np
import pytest
from wrench_cases import DT, FULL, INERTIA, RIGID, SENSOR, TILTING, TIME, motion, record

from freqid.core.errors import UsageError
from freqid.core.vehicle import Inertia, MassProperties, Wing
from freqid.identify.loads.wrench import applied_wrench


def test_wings_that_stay_where_the_mass_properties_hold_change_nothing():
    values, _, _ = motion()
    values |= {"dw1": 0.4, "n1": 300 + TIME, "n2": 250 - TIME}
    maneuver = record(TILTING, SENSOR, **values)
    with_wings, without = (applied_wrench(maneuver, wings=w).history(DT) for w in (True, False))
    np.testing.assert_allclose(with_wings, without, rtol=1e-10, atol=1e-10)


def test_wings_elsewhere_have_the_parallel_axes_inertia_of_that_place():
    """Held at another tilt, the vehicle is a rigid one whose mass properties are summed up by hand."""
    values, _, _ = motion()
    vehicle = msgspec.structs.replace(TILTING, rotors=())
    wing = vehicle.wings[0]

    def at(tilt):
        c, s = np.cos(tilt), np.sin(tilt)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        centre = wing.pivot_m + turn @ np.subtract(wing.cg_m, wing.pivot_m)
        return centre, turn @ wing.inertia.matrix @ turn.T + 3.0 * steiner(centre)

    def steiner(x):
        return x @ x * np.eye(3) - np.outer(x, x)

    stated = np.array(RIGID.mass_properties.cg_m)
    (old, old_inertia), (new, new_inertia) = at(0.4), at(1.3)
    cg = stated + 3.0 / 12.0 * (new - old)
    about_origin = INERTIA.matrix + 12.0 * steiner(stated) - old_inertia + new_inertia
    m = about_origin - 12.0 * steiner(cg)
    moved = MassProperties(
        mass_kg=12.0,
        cg_m=tuple(cg),
        inertia=Inertia(xx=m[0, 0], yy=m[1, 1], zz=m[2, 2], xz=-m[0, 2], xy=-m[0, 1], yz=-m[1, 2]),
    )
    found = applied_wrench(record(vehicle, SENSOR, **values, dw1=1.3)).history(DT)
    rigid = msgspec.structs.replace(RIGID, mass_properties=moved)
    wanted = applied_wrench(record(rigid, SENSOR, **values)).history(DT)
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-10)


def test_a_rotor_without_inertia_needs_no_speed_and_a_wing_without_mass_no_tilt():
    light = msgspec.structs.replace(
        TILTING,
        rotors=tuple(msgspec.structs.replace(r, inertia=0.0) for r in TILTING.rotors),
        wings=(Wing(name="main", tilt="dw1", pivot_m=(0.6, 0.0, -0.2)),),
    )
    values = {k: v for k, v in FULL.items() if k not in ("n1", "n2", "dw1")}
    found, rigid = (applied_wrench(record(v, **values)).history(DT) for v in (light, RIGID))
    np.testing.assert_array_equal(found, rigid)


def test_a_wing_without_mass_still_turns_its_rotors():
    wing = Wing(name="main", tilt="dw1", pivot_m=(0.6, 0.0, -0.2))
    vehicle = msgspec.structs.replace(TILTING, wings=(wing,), rotors=TILTING.rotors[:1])
    found = applied_wrench(record(vehicle, p=0.0, q=0.0, r=0.3, n1=400.0, dw1=np.pi / 2), "LMN").history(DT)
    # Shaft up at 90 deg, so yawing turns only its sideways part, -0.1 / sqrt(1.01), into a moment.
    np.testing.assert_allclose(found[0], 0.3 * 0.02 * 400.0 * 0.1 / np.sqrt(1.01), rtol=1e-12)


def test_a_wing_with_mass_needs_a_centre_of_gravity():
    wing = msgspec.structs.replace(TILTING.wings[0], cg_m=None)
    vehicle = msgspec.structs.replace(TILTING, wings=(wing,))
    with pytest.raises(UsageError, match=r"'main' has a mass of 3 kg but no centre of gravity; add cg_m"):
        applied_wrench(record(vehicle, **FULL))


def test_a_sensor_at_the_stated_centre_of_gravity_feels_it_leave():
    """Without rotation the force is ``m ax`` and the wing's mass times its own acceleration in the body."""
    vehicle = msgspec.structs.replace(TILTING, rotors=())
    tilt, rate, change = 0.4 + 0.05 * TIME**2, 0.1 * TIME, 0.1
    cg = dict.fromkeys(("ax", "ay", "az"), RIGID.mass_properties.cg_m)
    maneuver = record(vehicle, cg, p=0.0, q=0.0, r=0.0, ax=1.0, ay=0.0, az=-9.0, dw1=tilt)
    x, _, z = applied_wrench(maneuver, "XYZ").history(DT)
    forward, down = 0.3, -0.05  # the wing's centre of gravity from its pivot
    along = forward * np.cos(tilt) + down * np.sin(tilt)
    below = down * np.cos(tilt) - forward * np.sin(tilt)
    # A turn about y moves (x, z) by (z, -x) times the rate.
    np.testing.assert_allclose(x, 12.0 + 3.0 * (below * change - along * rate**2), rtol=1e-5)
    np.testing.assert_allclose(z, -108.0 - 3.0 * (along * change + below * rate**2), rtol=1e-5)


@pytest.mark.parametrize(
    "change",
    [
        {"mass_kg": 13.0},
        {"inertia": Inertia(xx=9.0, yy=0.2, zz=9.1)},
        {
            "cg_m": (1.85, 0.0, -0.2)
        },  # leaves 0.3 kg m2 about the vehicle's centre, less than none about its own
    ],
)
def test_a_wing_that_outweighs_its_vehicle_is_refused(change):
    wing = msgspec.structs.replace(TILTING.wings[0], **change)
    vehicle = msgspec.structs.replace(TILTING, wings=(wing,))
    with pytest.raises(UsageError, match=r"without its wings.*expected both positive; correct the mass"):
        applied_wrench(record(vehicle, **FULL))
