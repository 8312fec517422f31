"""Groups of parameters that cannot be separated, and those that can."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.identify.regress.regression import least_squares

NAMES = ("a", "b", "c", "d", "e", "f")


def examine(mix, noise=0.0, n=6, seed=5):
    """Collinearity of random complex columns that `mix` makes dependent, up to some noise."""
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((n, 80)) + 1j * rng.standard_normal((n, 80))
    for target, source in mix.items():
        phi[target] = sum(weight * phi[i] for i, weight in source.items())
        phi[target] = phi[target] + noise * (rng.standard_normal(80) + 1j * rng.standard_normal(80))
    return least_squares(phi, phi[:1] + 1.0, names=[f"n{i}" for i in range(n)] if n > 6 else NAMES[:n])


@pytest.mark.parametrize(
    ("mix", "groups"),
    [
        ({1: {0: 1.0}}, (("a", "b"),)),
        ({1: {0: -20.0}, 4: {3: 0.1}}, (("a", "b"), ("d", "e"))),
        ({2: {0: 1.0, 1: -1.0}}, (("a", "b", "c"),)),
        ({2: {0: 1.0}, 4: {0: 1.0}}, (("a", "c", "e"),)),
        ({1: {0: 1.0}, 5: {2: 1.0, 3: 1.0, 4: 1.0}}, (("a", "b"), ("c", "d", "e", "f"))),
    ],
)
def test_near_and_exact_dependences_are_grouped_alike(mix, groups):
    assert examine(mix, noise=1e-3).collinearity.inseparable() == groups
    with pytest.raises(DataError) as caught:
        examine(mix)
    named = "; ".join(" and ".join(f"'{name}'" for name in group) for group in groups)
    assert str(caught.value).startswith(named + " are perfectly collinear")


def test_eighteen_rotors_that_move_together_are_one_group():
    fit = examine({i: {0: 1.0} for i in range(1, 18)}, noise=1e-3, n=21)
    assert fit.collinearity.inseparable() == (tuple(f"n{i}" for i in range(18)),)


def test_well_separated_regressors_have_no_group():
    collinearity = examine({}).collinearity
    assert collinearity.condition_number < 3
    assert collinearity.inseparable() == ()


def test_thresholds_move_the_verdict():
    """A pair with correlation 0.98: condition index 11, below the usual 30."""
    collinearity = examine({1: {0: 1.0}}, noise=0.2).collinearity
    assert 5 < collinearity.condition_number < 20
    assert collinearity.inseparable() == ()
    assert collinearity.inseparable(condition_index=5.0) == (("a", "b"),)
    assert collinearity.inseparable(condition_index=5.0, proportion=0.9999) == ()


def test_shares_of_variance_add_up():
    collinearity = examine({1: {0: 1.0}}, noise=0.1).collinearity
    np.testing.assert_allclose(collinearity.proportion.sum(axis=0), 1.0)
    assert (np.diff(collinearity.condition_index) >= 0).all()
    assert collinearity.condition_index[0] == 1.0


def test_a_regressor_like_an_end_term_is_named_with_it():
    lines = np.arange(40)
    rng = np.random.default_rng(6)
    noise = rng.standard_normal((2, 40)) + 1j * rng.standard_normal((2, 40))
    end = np.exp(-0.2j * lines)
    phi = np.array([noise[0], end + 1e-3 * noise[1]])
    fit = least_squares(phi, noise[:1], names=["q", "de1"], nuisance=end[None], nuisance_names=["end of q'"])
    assert fit.collinearity.inseparable() == (("end of q'", "de1"),)
