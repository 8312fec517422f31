import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.simulate.air.atmosphere import air, altitude_of


@pytest.mark.parametrize("altitude", [-500.0, 0.0, 1234.5, 10_500.0])
def test_altitude_of_a_density_is_the_inverse_of_the_density_at_an_altitude(altitude):
    assert altitude_of(float(air(jnp.asarray(altitude)).rho)) == pytest.approx(altitude, abs=1e-6)


def test_pressure_has_no_kink_in_its_logarithm_at_the_tropopause():
    # Hydrostatics: the slope of log p is -g / (R T), continuous because T is.
    slope = jax.vmap(jax.grad(lambda h: jnp.log(air(h).pressure)))(jnp.array([11018.0, 11021.0]))
    assert float(slope[0]) == pytest.approx(float(slope[1]), rel=1e-4)
    assert float(slope[1]) == pytest.approx(-9.80665 / (287.05287 * 216.65), rel=0.004)  # g at 11 km


def test_air_broadcasts_over_altitudes():
    assert np.shape(air(jnp.zeros((2, 3))).rho) == (2, 3)
