from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle, Wing
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude, multibody, rigid_body
from freqid.simulate.motion.multibody import Configuration
from freqid.simulate.motion.rigid_body import BodyState

INERTIA = Inertia(xx=4.0, yy=7.0, zz=9.0, xz=0.2)
WING = Wing(
    name="front",
    tilt="dw1",
    pivot_m=(0.5, 0.0, 0.0),
    mass_kg=5.0,
    cg_m=(0.7, 0.0, 0.1),
    inertia=Inertia(xx=1.0, yy=0.1, zz=1.0),
)


def vehicle(wings=(WING,), rotors=(), **properties):
    whole = MassProperties(**{"mass_kg": 20.0, "inertia": INERTIA, "cg_m": (0.1, 0.0, 0.02)} | properties)
    return Vehicle(
        name="v", mass_properties=whole, tilt_rad={w.name: 0.4 for w in wings}, wings=wings, rotors=rotors
    )


def still(wings=1, rotors=0):
    return Configuration(jnp.zeros(wings), jnp.zeros(wings), jnp.zeros(rotors))


def body(rates=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    return BodyState(jnp.zeros(3), attitude.from_euler(0.0, 0.0, 0.0), jnp.array(velocity), jnp.array(rates))


@partial(jax.jit, static_argnames="gravity")
def accelerations(model, configuration, change, at, force, moment, gravity=0.0):
    return rigid_body.accelerations(model, configuration, change, at, Wrench(force, moment), gravity)


def test_the_parts_put_together_at_the_stated_tilt_are_the_whole():
    model = multibody.mass_model(vehicle())
    moment, inertia = multibody.moments_of_mass(model, jnp.array([0.4]))
    cg = np.array([0.1, 0.0, 0.02])
    assert np.allclose(moment, 20.0 * cg, rtol=1e-14)
    expected = INERTIA.matrix + 20.0 * (cg @ cg * np.eye(3) - np.outer(cg, cg))
    assert np.allclose(inertia, expected, rtol=1e-13)


def test_tilting_up_moves_the_centre_of_gravity_by_hand():
    # 5 kg of 20 move from 0.2 m ahead of and 0.1 m below the pivot to 0.1 m ahead and 0.2 m above it.
    level, up = (
        multibody.traced_centre_of_gravity(multibody.mass_model(vehicle()), jnp.array([tilt]))
        for tilt in (0.0, np.pi / 2)
    )
    assert np.allclose(up - level, np.array([0.1 - 0.2, 0.0, -0.2 - 0.1]) * 5 / 20, atol=1e-14)


def test_a_hanging_force_through_the_centre_of_gravity_balances_the_weight():
    model = multibody.mass_model(vehicle(wings=()))
    lift = jnp.array([0.0, 0.0, -20.0 * 9.80665])
    moment = jnp.cross(jnp.array([0.1, 0.0, 0.02]), lift)
    along, turning = accelerations(model, still(0), still(0), body(), lift, moment, 9.80665)
    assert np.allclose(np.concatenate([along, turning]), 0.0, atol=1e-12)


def test_a_spinning_rotor_pitched_up_yaws_and_a_sped_up_one_rolls_the_body():
    rotor = Rotor(name="n1", spin=1, inertia=0.01)
    model = multibody.mass_model(vehicle(wings=(), rotors=(rotor,), cg_m=(0.0, 0.0, 0.0)))
    spinning = Configuration(jnp.zeros(0), jnp.zeros(0), jnp.array([300.0]))
    faster = Configuration(jnp.zeros(0), jnp.zeros(0), jnp.array([50.0]))
    zero = jnp.zeros(3)
    # N of K&M: applied moment 0 = Iz r' - p hy.. with h = (hx, 0, 0): M = -r.., N = -q hx + Iz r' - Ixz p'.
    _, turning = accelerations(model, spinning, still(0, 1), body(rates=(0.0, 0.2, 0.0)), zero, zero)
    assert INERTIA.zz * turning[2] - INERTIA.xz * turning[0] == pytest.approx(0.2 * 0.01 * 300.0)
    _, turning = accelerations(model, spinning, faster, body(), zero, zero)
    assert INERTIA.xx * turning[0] - INERTIA.xz * turning[2] == pytest.approx(-0.01 * 50.0)


def test_the_state_of_rest_differentiates():
    model = multibody.mass_model(vehicle())
    flat = lambda w: sum(jnp.sum(x) for x in accelerations(model, still(), still(), body(), w, w))  # noqa: E731
    assert np.all(np.isfinite(jax.grad(flat)(jnp.zeros(3))))


def test_euler_angles_survive_the_quaternion():
    angles = (0.3, -1.2, 2.8)
    assert np.allclose(attitude.euler(attitude.from_euler(*angles)), angles, atol=1e-14)
    there = attitude.to_ground(attitude.from_euler(*angles), jnp.array([1.0, -2.0, 0.5]))
    assert np.allclose(attitude.to_body(attitude.from_euler(*angles), there), [1.0, -2.0, 0.5], atol=1e-14)
    assert np.allclose(attitude.down(attitude.from_euler(0.0, 0.3, 1.0)), [-np.sin(0.3), 0, np.cos(0.3)])


def test_wings_that_cannot_be_inside_the_vehicle_are_refused():
    with pytest.raises(UsageError, match=r"without its wings has a mass of -5 kg.*hold with its wings on"):
        multibody.mass_model(vehicle(wings=(heavy(25.0),)))
    lost = Wing(name="front", tilt="dw1", pivot_m=(0.5, 0.0, 0.0), mass_kg=5.0)
    with pytest.raises(UsageError, match=r"wing 'front' has a mass of 5 kg but no centre of gravity"):
        multibody.mass_model(vehicle(wings=(lost,)))


def heavy(mass):
    return Wing(name="front", tilt="dw1", pivot_m=(0.0, 0.0, 0.0), cg_m=(0.1, 0.0, 0.0), mass_kg=mass)
