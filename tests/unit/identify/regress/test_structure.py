"""What structure determination does with nothing to find, with copies, and with bad requests."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.identify.regress.orthogonal import orthogonal_functions
from freqid.identify.regress.structure import stepwise

BOTH = pytest.mark.parametrize("choose", [stepwise, orthogonal_functions])


@pytest.fixture
def candidates():
    rng = np.random.default_rng(1)
    return rng.standard_normal((4, 80)) + 1j * rng.standard_normal((4, 80))


@pytest.fixture
def noise():
    rng = np.random.default_rng(2)
    return rng.standard_normal(80) + 1j * rng.standard_normal(80)


@BOTH
def test_an_exact_model_is_found_exactly(candidates, choose):
    result = choose(candidates, np.array([0.0, 2.0, 0.0, -3.0]) @ candidates, names=list("abcd"))
    assert result.terms == ("d", "b")
    estimate = result.fit.estimate[0] if choose is stepwise else result.estimate
    np.testing.assert_allclose(estimate, [-3.0, 2.0], rtol=1e-12)


def test_noise_alone_chooses_nothing(candidates, noise):
    result = stepwise(candidates, noise)
    assert (result.terms, result.steps, result.fit) == ((), (), None)


def test_orthogonal_functions_may_choose_nothing(candidates, noise):
    """No candidate explains more of the response than one equation's share."""
    basis = np.linalg.qr(np.hstack([candidates.real, candidates.imag]).T)[0]
    left = np.concatenate([noise.real, noise.imag])
    left -= basis @ (basis.T @ left)
    model = orthogonal_functions(candidates, left[:80] + 1j * left[80:] + 1e-9 * candidates[0])
    assert model.terms == ()
    assert model.estimate.shape == model.std_error.shape == (0,)
    assert len(model.steps) == 4


@BOTH
def test_a_copy_of_a_chosen_term_is_passed_over(candidates, noise, choose):
    copies = np.vstack([candidates, 5.0 * candidates[2]])
    result = choose(copies, candidates[2] + candidates[1] + 0.1 * noise, names=list("abcde"))
    assert set(result.terms) in ({"b", "c"}, {"b", "e"})
    assert len({step.name for step in result.steps} & {"c", "e"}) == 1


@BOTH
def test_nuisance_columns_are_in_every_model(candidates, noise, choose):
    end = np.exp(-0.3j * np.arange(80))[None]
    z = candidates[0] + 50.0 * end[0] + noise
    result = choose(candidates, z, names=list("abcd"), nuisance=end)
    assert result.terms[0] == "a"
    assert result.steps[0].r2 < 0.9  # not of the nuisance column's part
    estimate = result.fit.estimate[0] if choose is stepwise else result.estimate
    assert estimate[0] == pytest.approx(1.0, abs=0.4)


@BOTH
def test_fewer_independent_equations_admit_fewer_terms(candidates, noise, choose):
    z = np.array([3.0, 0.6, 0.0, 0.0]) @ candidates + noise
    assert choose(candidates, z, names=list("abcd")).terms == ("a", "b")
    assert choose(candidates, z, names=list("abcd"), independent_share=0.1).terms == ("a",)


@BOTH
def test_bad_requests(candidates, noise, choose):
    with pytest.raises(UsageError, match="one response at a time, found 2"):
        choose(candidates, np.array([noise, noise]))
    with pytest.raises(UsageError, match="differ in their number of lines"):
        choose(candidates, noise[:-1])
    with pytest.raises(DataError, match="leave nothing to choose terms by"):
        choose(candidates[:, :1], noise[:1], nuisance=np.ones((1, 1)))
    with pytest.raises(DataError, match="or a response that moves"):
        choose(candidates, 0.0 * noise)
    candidates[1] = 0.0
    with pytest.raises(DataError, match="candidate 2' is zero"):
        choose(candidates, noise)
    candidates[1, 3] = np.nan
    with pytest.raises(DataError, match="candidate 'b' has 1 of 80"):
        choose(candidates, noise, names=list("abcd"))


def test_thresholds_that_would_never_end(candidates, noise):
    with pytest.raises(UsageError, match="would add and drop a term for ever"):
        stepwise(candidates, noise, f_enter=4.0, f_leave=5.0)


def test_errors_after_a_choice_hold_what_was_left_out():
    """One effect is at the edge of being found; what is kept beside it must still hold the truth.

    Two correlated columns, the second effect three standard errors large: in 300 draws it is dropped in half,
    and the first then stands for it. The truth is known, so coverage is counted.
    """
    from types import SimpleNamespace

    from freqid.identify.model import selection

    rng = np.random.default_rng(5)
    first, other = rng.standard_normal((2, 120))
    columns = np.array([first, 0.6 * first + 0.8 * other])
    true = np.array([2.0, 3.0 / np.sqrt(120 * 0.64)])

    def fitted(kept, z):
        x = columns[kept]
        inverse = np.linalg.inv(x @ x.T)
        theta = inverse @ x @ z
        left = z - theta @ x
        return SimpleNamespace(
            regressors=tuple("ab"[i] for i in kept),
            estimate=theta,
            covariance=inverse * (left @ left) / (120 - len(kept)),
        )

    widened, said = [], []
    original, selection.with_covariance = selection.with_covariance, lambda chosen, c: c
    try:
        for _ in range(300):
            z = true @ columns + rng.standard_normal(120)
            full = fitted([0, 1], z)
            f = full.estimate[1] ** 2 / full.covariance[1, 1]
            chosen = full if f > selection.F_TO_STAY else fitted([0], z)
            covariance = selection.with_choice(chosen, full)
            off = abs(chosen.estimate[0] - true[0])
            said.append(off < 1.98 * np.sqrt(chosen.covariance[0, 0]))
            widened.append(off < 1.98 * np.sqrt(covariance[0, 0]))
    finally:
        selection.with_covariance = original
    assert np.mean(said) < 0.88
    assert 0.92 < np.mean(widened) < 0.99
