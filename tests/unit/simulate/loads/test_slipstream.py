"""Slipstreams against the actuator disc."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.simulate.loads.propeller import Discs
from freqid.simulate.loads.slipstream import Slipstreams, added_velocity, induced_velocity

R, RHO = 0.2032, 1.2
AREA = np.pi * R**2


def induced(thrust: float, axial: float, across: float = 0.0) -> float:
    arrays = (jnp.array([x]) for x in (thrust, axial, across, AREA))
    return float(induced_velocity(*arrays, jnp.float64(RHO))[0])


def test_hover():
    assert induced(35.0, 0.0) == pytest.approx(np.sqrt(35.0 / (2 * RHO * AREA)), rel=3e-5)


@pytest.mark.parametrize("speed", [5.0, 15.0, 26.0])
@pytest.mark.parametrize("thrust", [35.0, 5.0, -1.0])
def test_axial_flight(speed, thrust):
    exact = -speed / 2 + np.sqrt(speed**2 / 4 + thrust / (2 * RHO * AREA))
    assert induced(thrust, speed) == pytest.approx(exact, rel=4e-4)
    # the power balance of the disc: T (U + v) is the gain of the stream's kinetic energy
    flow = RHO * AREA * (speed + exact)
    assert thrust * (speed + exact) == pytest.approx(0.5 * flow * ((speed + 2 * exact) ** 2 - speed**2))


@pytest.mark.parametrize(("axial", "across"), [(0.0, 20.0), (8.0, 8.0), (3.0, 12.0), (20.0, 1.0)])
def test_oblique_flight_satisfies_momentum(axial, across):
    v = induced(30.0, axial, across)
    climb = axial * 0.5 * (1 + np.tanh(axial))
    assert 2 * RHO * AREA * v * np.sqrt((climb + v) ** 2 + across**2 + 0.01) == pytest.approx(30.0, rel=1e-12)


def test_no_disc_takes_more_from_the_wind_than_momentum_theory_allows():
    assert -5.0 < induced(-500.0, 10.0) < -3.5


def test_fast_edgewise_flight_is_a_wing_of_circular_span():
    # T = 2 rho A V v: the lifting line of span 2 R
    assert induced(30.0, 0.0, 60.0) == pytest.approx(30.0 / (2 * RHO * AREA * 60.0), rel=1e-3)


def test_descent_keeps_the_hover_value_and_stays_smooth():
    assert induced(35.0, -8.0) == pytest.approx(induced(35.0, 0.0), rel=1e-6)
    slope = jax.jit(jax.vmap(jax.grad(lambda u: induced_velocity(jnp.float64(35.0), u, 0.0, AREA, RHO))))
    assert np.all(np.abs(np.diff(slope(jnp.linspace(-3, 3, 61)))) < 0.1)


def one(distance: float, mixing: float = 1e-4, drop: float = 0.0) -> Slipstreams:
    edges = np.linspace(-1, 1, 201)
    return Slipstreams(
        radius=jnp.array([R]),
        distance=jnp.array([distance]),
        drop=jnp.array([drop]),
        place=jnp.ones((1, 1, 1)),
        edges=jnp.asarray(edges)[None, None],
        width=jnp.asarray(np.diff(edges))[None],
        mixing=jnp.float64(mixing),
    )


def disc(thrust: float, axial: float, across=(0.0, 0.0, 0.0)) -> Discs:
    none = jnp.zeros((1, 3))
    return Discs(jnp.array([axial]), jnp.array([across]), jnp.array([thrust]), jnp.zeros(1), none, none)


@pytest.mark.parametrize(("distance", "share"), [(0.0, 1.0), (100.0, 2.0)])
def test_velocity_and_width_go_from_the_disc_to_the_far_slipstream(distance, share):
    over, v = added_velocity(one(distance), disc(35.0, 0.0), jnp.float64(RHO))
    over = np.asarray(over)[0]
    assert over.max() == pytest.approx(share * float(v[0]), rel=1e-4)
    wetted = over.sum() * 0.01 / over.max()
    assert wetted == pytest.approx(2 * R / np.sqrt(share), rel=1e-4)  # in hover the area halves


def test_mixing_moves_the_edge_but_not_the_flow():
    sharp, _ = added_velocity(one(0.2), disc(35.0, 5.0), jnp.float64(RHO))
    soft, _ = added_velocity(one(0.2, mixing=0.03), disc(35.0, 5.0), jnp.float64(RHO))
    # the hat keeps its integral; the missing height of the tube costs a little
    height = 0.5 * 2 / np.sqrt(1 + (0.03 / 0.17) ** 2)
    assert float(soft.sum() / sharp.sum()) == pytest.approx(height, abs=0.01)


def test_cross_flow_carries_the_slipstream_away():
    over, _ = added_velocity(one(0.2), disc(35.0, 0.0, (0.0, 5.0, 0.0)), jnp.float64(RHO))
    centre = float(np.asarray(over)[0] @ np.linspace(-0.995, 0.995, 200) / over.sum())
    assert centre < -0.05  # moving right leaves it behind on the left
    below, _ = added_velocity(one(0.4), disc(35.0, 0.0, (0.0, 0.0, 30.0)), jnp.float64(RHO))
    assert float(below.max()) < 1e-3 * float(over.max())  # falling leaves it above the wing
