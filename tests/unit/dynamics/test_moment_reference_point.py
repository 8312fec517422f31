import jax
import jax.numpy as jnp
import numpy as np

from freqid.dynamics.moment_reference_point import moment_about

RNG = np.random.default_rng(5)
PLACES, FORCES, OLD, NEW = RNG.normal(size=(40, 3)), RNG.normal(size=(40, 3)), *RNG.normal(size=(2, 3))


def summed(about):
    """Return force and moment of many point forces about a point, each force's moment by itself."""
    return FORCES.sum(axis=0), np.cross(PLACES - about, FORCES).sum(axis=0)


def test_point_forces_summed_about_one_point_and_brought_to_another_are_those_summed_there():
    force, moment = summed(OLD)
    np.testing.assert_allclose(moment_about(OLD - NEW, force, moment), summed(NEW)[1], rtol=0, atol=1e-12)


def test_a_force_alone_has_the_moment_of_its_place_in_rows_of_channels_and_of_instants():
    expected = np.cross(PLACES - NEW, FORCES)
    np.testing.assert_array_equal(moment_about(PLACES - NEW, FORCES, axis=-1), expected)
    np.testing.assert_array_equal(moment_about((PLACES - NEW).T, FORCES.T), expected.T)


def test_one_point_serves_all_samples_of_a_force():
    found = moment_about(OLD[:, None], FORCES.T, np.ones((3, 40)))
    np.testing.assert_array_equal(found, np.cross(OLD, FORCES).T + 1.0)


def test_jax_compiles_batches_and_differentiates_it():
    force, moment = summed(OLD)
    function = jax.jit(lambda point: moment_about(OLD - point, jnp.asarray(force), moment, axis=-1))
    points = jnp.asarray(RNG.normal(size=(6, 3)))
    expected = [summed(np.asarray(point))[1] for point in points]
    np.testing.assert_allclose(jax.vmap(function)(points), expected, rtol=0, atol=1e-12)
    x, y, z = force  # M = (old - point) x F, so dM / dpoint = [F]x
    np.testing.assert_allclose(
        jax.jacfwd(function)(points[0]), [[0, -z, y], [z, 0, -x], [-y, x, 0]], rtol=0, atol=1e-12
    )
