"""Propellers against the definition of their coefficients, and what oblique flow must do."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.simulate.loads.propeller import Propellers, discs

D, RHO = 0.4064, 1.2
THRUST, TORQUE = [0.095, -0.039, -0.136, -0.035], [0.0049, 0.0020, 0.0015, -0.020]
FORWARD = np.array([1.0, 0.0, 0.0])


def propeller(spin: float = 1.0, **changes) -> Propellers:
    values = {"crossflow_thrust": 0.02, "inplane_force": 0.02, "hub_moment": 0.02} | changes
    return Propellers(
        frame=jnp.eye(1),
        hub=jnp.zeros((1, 3)),
        axis=jnp.asarray(FORWARD)[None],
        spin=jnp.array([spin]),
        diameter=jnp.array([D]),
        thrust=jnp.array(THRUST),
        torque=jnp.array(TORQUE),
        **{name: jnp.float64(value) for name, value in values.items()},
    )


def at(velocity, speed: float, **changes):
    return discs(propeller(**changes), jnp.array([velocity]), jnp.array([speed]), jnp.float64(RHO))


@pytest.mark.parametrize("j", [0.0, 0.2, 0.5, 0.7])
def test_axial_coefficients_are_the_bounded_cubic(j):
    n = 100.0
    disc = at([j * n * D, 0.0, 0.0], 2 * np.pi * n)
    bounded = np.sqrt(1 + j**2)
    for found, c, scale in ((disc.thrust, THRUST, D**4), (disc.torque, TORQUE, D**5)):
        expected = c[0] + c[1] * j + (c[2] * j**2 + c[3] * j**3) / bounded
        scale *= RHO * n**2
        assert float(found[0]) == pytest.approx(scale * expected, abs=1e-5 * scale * c[0])


def test_a_stopped_propeller_drags_and_is_driven_by_the_wind():
    forward, backward = at([20.0, 0.0, 0.0], 0.0), at([-20.0, 0.0, 0.0], 0.0)
    assert float(forward.thrust[0]) == pytest.approx(THRUST[3] * RHO * D**2 * 400, rel=1e-4)
    assert float(forward.torque[0]) < 0
    np.testing.assert_allclose(backward.thrust, -forward.thrust)


def test_nothing_breaks_at_rest():
    slopes = jax.jacobian(lambda u, s: at(u, s).thrust, argnums=(0, 1))(jnp.zeros(3), jnp.float64(0.0))
    assert all(np.all(np.isfinite(s)) for s in slopes)
    assert float(at([0.0, 0.0, 0.0], 0.0).thrust[0]) == 0.0


def test_inflow_from_below_pushes_up_and_yaws_the_nose_left_where_the_right_blade_goes_down():
    disc = at([15.0, 0.0, 5.0], 600.0)  # spin +1: right-handed about forward, right blade down
    assert float(disc.inplane_force[0, 2]) < 0
    assert float(disc.hub_moment[0, 2]) < 0
    np.testing.assert_allclose(at([15.0, 0.0, 5.0], 600.0, spin=-1.0).hub_moment, -disc.hub_moment)
    np.testing.assert_allclose(np.asarray(disc.inplane_force)[0, :2], 0)


def test_edgewise_flow_adds_thrust():
    still, moving = at([0.0, 0.0, 0.0], 660.0), at([0.0, 6.0, 8.0], 660.0)
    tip = 660.0 / (2 * np.pi) * D
    gain = float(moving.thrust[0] - still.thrust[0]) / (RHO * D**2)
    assert gain == pytest.approx(0.02 * 100 / (1 + 100 / tip**2), rel=1e-4)
