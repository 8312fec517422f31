import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from freqid.core.errors import UsageError
from freqid.dynamics.frames import (
    body_velocity,
    cross,
    flow_angles,
    shaft_axis,
    specific_force_at,
    stability_from_body,
    turn_about_y,
)

vectors = arrays(float, (3, 4), elements=st.floats(-1e3, 1e3))
angles = st.floats(-np.pi, np.pi)


@settings(derandomize=True, deadline=None)
@given(vectors, vectors)
def test_cross_is_numpy_s(a, b):
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b, axis=0))


def test_cross_broadcasts_one_vector_over_samples():
    one, many = np.array([[1.0], [0.0], [0.0]]), np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(cross(one, many), np.cross(one, many, axis=0))


def test_a_forward_shaft_at_ninety_degrees_points_up():
    np.testing.assert_allclose(shaft_axis((2.0, 0.0, 0.0), np.pi / 2), (0.0, 0.0, -1.0), atol=1e-15)


def test_a_shaft_follows_every_sample_of_its_tilt_and_stays_a_unit_vector():
    tilt = np.linspace(-0.2, 1.7, 7)
    shaft = shaft_axis((3.0, 1.0, -0.5), tilt)
    assert shaft.shape == (3, 7)
    np.testing.assert_allclose(np.linalg.norm(shaft, axis=0), 1.0)
    np.testing.assert_allclose(shaft[1], 1.0 / np.sqrt(10.25))


@pytest.mark.parametrize("axis", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0)])
def test_a_shaft_without_direction_is_refused(axis):
    with pytest.raises(UsageError, match="has no direction"):
        shaft_axis(axis, 0.3)


@settings(derandomize=True, deadline=None)
@given(vectors, angles, angles)
def test_turns_add_up_and_keep_lengths(a, first, second):
    both = turn_about_y(turn_about_y(a, first), second)
    np.testing.assert_allclose(both, turn_about_y(a, first + second), atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(both, axis=0), np.linalg.norm(a, axis=0), atol=1e-11)


@settings(derandomize=True, deadline=None)
@given(st.floats(1.0, 200.0), st.floats(-3.1, 3.1), st.floats(-1.5, 1.5))
def test_flow_angles_and_velocity_are_inverses(speed, alpha, beta):
    velocity = body_velocity(speed, alpha, beta)
    assert velocity[1] == pytest.approx(speed * np.sin(beta), abs=1e-12)
    np.testing.assert_allclose(flow_angles(velocity), (speed, alpha, beta), rtol=1e-12, atol=1e-12)


def test_flow_angles_by_hand_and_at_rest():
    np.testing.assert_allclose(
        flow_angles(np.array([3.0, 12.0, 4.0])), (13.0, np.arctan2(4, 3), np.arcsin(12 / 13))
    )
    np.testing.assert_array_equal(flow_angles(np.zeros((3, 2))), np.zeros((3, 2)))


@settings(derandomize=True, deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(1.0, 100.0))
def test_the_reference_velocity_lies_along_x_stability(alpha, speed):
    turned = stability_from_body(alpha) @ body_velocity(speed, alpha, 0.0)
    np.testing.assert_allclose(turned, (speed, 0.0, 0.0), atol=1e-12)


def test_lift_is_minus_z_stability():
    x, z, alpha = -3.0, -50.0, 0.2
    _, _, found = stability_from_body(alpha) @ np.array([x, 0.0, z])
    assert -found == pytest.approx(x * np.sin(alpha) - z * np.cos(alpha))  # textbook lift


def test_specific_force_of_a_turntable():
    """At constant yaw rate a sensor ahead of the axis reads the pull towards it."""
    rates = np.array([[0.0], [0.0], [2.0]])
    none = np.zeros((3, 1))
    found = specific_force_at(none, rates, none, (1.5, 0.0, 0.0))
    np.testing.assert_allclose(found[:, 0], (-6.0, 0.0, 0.0))
    # Spinning up adds the tangential part, to the right for a nose going right.
    found = specific_force_at(none, rates, np.array([[0.0], [0.0], [0.7]]), (1.5, 0.0, 0.0))
    np.testing.assert_allclose(found[:, 0], (-6.0, 1.05, 0.0))


@settings(derandomize=True, deadline=None)
@given(vectors, vectors, vectors, st.tuples(*[st.floats(-3, 3)] * 3))
def test_specific_force_moves_there_and_back(force, rates, acceleration, offset):
    there = specific_force_at(force, rates, acceleration, offset)
    back = specific_force_at(there, rates, acceleration, tuple(-o for o in offset))
    np.testing.assert_allclose(back, force, atol=1e-7)
