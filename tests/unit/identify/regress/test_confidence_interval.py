import numpy as np
import pytest
from scipy.integrate import quad

from freqid.identify.regress.confidence_interval import confidence_interval, half_width

# Two-sided 95 % points of Student's t, as tables print them (Fisher & Yates, Statistical Tables, table III).
TABLE = {1: 12.706, 2: 4.303, 5: 2.571, 10: 2.228, 30: 2.042, 120: 1.980, np.inf: 1.960}


def test_it_reaches_as_far_as_tables_of_student_s_t_say():
    reach = half_width(degrees_of_freedom=list(TABLE))
    np.testing.assert_allclose(reach, list(TABLE.values()), rtol=0, atol=5.1e-4)


@pytest.mark.parametrize("level", [0.5, 0.9, 0.99])
def test_the_density_of_t_between_the_limits_integrates_to_the_level(level):
    low, high = confidence_interval(0.0, 1.0, level=level, degrees_of_freedom=3)
    density = lambda t: 2 / (np.pi * np.sqrt(3) * (1 + t**2 / 3) ** 2)  # noqa: E731  of three degrees
    assert quad(density, low, high)[0] == pytest.approx(level, abs=1e-10)


def test_limits_stand_about_each_estimate_and_an_unknown_error_has_none():
    low, high = confidence_interval([1.0, -2.0, 3.0], [0.1, 0.2, np.nan], degrees_of_freedom=[10, np.inf, 4])
    np.testing.assert_allclose(low, [1 - 0.2228, -2 - 0.392, np.nan], atol=1e-4)
    np.testing.assert_allclose(high, [1 + 0.2228, -2 + 0.392, np.nan], atol=1e-4)
