"""Stepwise regression and orthogonal functions against slow versions that refit every subset."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import loadmat

from freqid.identify.regress.orthogonal import orthogonal_functions
from freqid.identify.regress.regression import least_squares
from freqid.identify.regress.structure import stepwise


def stacked(table):
    return np.hstack([table.real, table.imag]) if np.iscomplexobj(table) else table


def square(rows, z):
    """Residual square of z on rows, by numpy's SVD solver."""
    if not len(rows):
        return float(z @ z)
    return float(np.sum((z - np.linalg.lstsq(rows.T, z, rcond=None)[0] @ rows) ** 2))


def slow_stepwise(candidates, z, nuisance, f_enter, f_leave):
    """Refit every model that differs by one term; return [(action, index, F, PSE)] and the terms."""
    n_equations, q = len(z), len(nuisance)

    def residual(terms):
        return square(np.vstack([nuisance, candidates[list(terms)]]), z)

    total = residual([])

    def pse(terms):
        return residual(terms) / n_equations + total / n_equations * (q + len(terms)) / n_equations

    def f_ratio(smaller, larger):
        return (residual(smaller) - residual(larger)) / (residual(larger) / (n_equations - q - len(larger)))

    terms, history = [], []
    while len(terms) < len(candidates):
        best = min((i for i in range(len(candidates)) if i not in terms), key=lambda i: residual([*terms, i]))
        f = f_ratio(terms, [*terms, best])
        if f < f_enter or pse([*terms, best]) >= pse(terms):
            break
        terms = [*terms, best]
        history.append(("add", best, f, pse(terms)))
        while len(terms) > 1:
            weakest = min(terms, key=lambda j: residual([i for i in terms if i != j]))
            rest = [i for i in terms if i != weakest]
            f = f_ratio(rest, terms)
            if f >= f_leave:
                break
            terms = rest
            history.append(("drop", weakest, f, pse(terms)))
    return history, terms


def make_problem(kind: str, seed: int):
    """Twelve correlated candidates, a true model of four, and noise."""
    rng = np.random.default_rng(seed)

    def noise(*shape):
        real = rng.standard_normal(shape)
        return real + 1j * rng.standard_normal(shape) if kind == "lines" else real

    candidates = noise(12, 60)
    candidates[8:] += candidates[:4] + candidates[1:5]
    z = np.array([2.0, -1.0, 0.6, 0.4]) @ candidates[[0, 3, 6, 8]] + noise(60)
    return candidates, z, np.exp(-0.2j * np.arange(60))[None] if kind == "lines" else np.ones((1, 60))


@pytest.mark.parametrize("kind", ["lines", "samples"])
@pytest.mark.parametrize("thresholds", [(20.0, 20.0), (4.0, 4.0), (2.0, 1.0)])
@pytest.mark.parametrize("seed", range(4))
def test_stepwise_is_the_slow_algorithm(kind, thresholds, seed):
    candidates, z, nuisance = make_problem(kind, seed)
    names = [f"c{i}" for i in range(12)]
    chosen = stepwise(
        candidates, z, names=names, nuisance=nuisance, f_enter=thresholds[0], f_leave=thresholds[1]
    )
    history, terms = slow_stepwise(stacked(candidates), stacked(z[None])[0], stacked(nuisance), *thresholds)
    assert chosen.terms == tuple(f"c{i}" for i in terms)
    assert [(s.action, s.name) for s in chosen.steps] == [(h[0], f"c{h[1]}") for h in history]
    np.testing.assert_allclose([s.partial_f for s in chosen.steps], [h[2] for h in history], rtol=1e-8)
    np.testing.assert_allclose([s.pse for s in chosen.steps], [h[3] for h in history], rtol=1e-10)
    last = chosen.steps[-1]
    np.testing.assert_allclose(
        [last.r2, last.pse, last.fit_error], [chosen.fit.r2[0], chosen.fit.pse[0], chosen.fit.fit_error[0]]
    )


@pytest.mark.parametrize("kind", ["lines", "samples"])
def test_true_terms_are_found_in_every_one_of_fifty_data_sets(kind):
    for seed in range(50):
        rng = np.random.default_rng(1000 + seed)
        shape = (20, 150)
        candidates = rng.standard_normal(shape) + (1j * rng.standard_normal(shape) if kind == "lines" else 0)
        truth = np.sort(rng.choice(20, 4, replace=False))
        noise = rng.standard_normal(150) + (1j * rng.standard_normal(150) if kind == "lines" else 0)
        z = np.array([1.0, -1.0, 1.5, 2.0]) @ candidates[truth] + noise
        names = [f"c{i:02d}" for i in range(20)]
        expected = {f"c{i:02d}" for i in truth}
        assert set(stepwise(candidates, z, names=names).terms) == expected


def test_a_term_that_later_ones_replace_is_dropped():
    """The sum of two terms explains most at first and nothing once both are in."""
    rng = np.random.default_rng(31)
    parts = rng.standard_normal((2, 200))
    both = parts.sum(axis=0) + 0.5 * rng.standard_normal(200)
    z = np.array([1.0, 1.3]) @ parts + 0.05 * rng.standard_normal(200)
    chosen = stepwise(np.vstack([parts, both]), z, names=["a", "b", "a+b"])
    history = [(step.action, step.name) for step in chosen.steps]
    assert history[0] == ("add", "a+b")
    assert history[-1] == ("drop", "a+b")
    assert set(chosen.terms) == {"a", "b"}
    assert chosen.steps[-1].r2 > 0.99


@pytest.mark.parametrize("kind", ["lines", "samples"])
def test_orthogonal_functions(kind):
    candidates, z, nuisance = make_problem(kind, 2)
    names = [f"c{i}" for i in range(12)]
    model = orthogonal_functions(candidates, z, names=names, nuisance=nuisance)
    index = [names.index(name) for name in model.terms]
    assert 2 <= len(index) < 12

    # The functions, made from the terms by the transform, are orthogonal beside the nuisance column.
    rows, extra = stacked(candidates)[index], stacked(nuisance)
    rows = rows - np.linalg.lstsq(extra.T, rows.T, rcond=None)[0].T @ extra
    functions = model.transform.T @ rows
    gram = functions @ functions.T
    np.testing.assert_allclose(gram, np.diag(np.diag(gram)), atol=1e-10 * gram.max())
    np.testing.assert_allclose(np.diag(model.transform), 1.0)
    np.testing.assert_allclose(np.tril(model.transform, -1), 0.0)
    target = stacked(z[None])[0]
    np.testing.assert_allclose(model.coefficient, functions @ target / np.diag(gram), rtol=1e-9)

    # Mapped back they are the ordinary estimates.
    fit = least_squares(candidates[index], z[None], names=model.terms, nuisance=nuisance)
    np.testing.assert_allclose(model.estimate, fit.estimate[0], rtol=1e-9)
    np.testing.assert_allclose(model.covariance, fit.covariance[0], rtol=1e-8, atol=1e-15)
    np.testing.assert_allclose(model.std_error, fit.std_error[0], rtol=1e-9)

    # Every step is the best next term, and the chosen length has the least predicted squared error.
    order = [names.index(step.name) for step in model.steps]
    assert sorted(order) == list(range(12))
    errors = []
    for m in range(12):
        left = [i for i in range(12) if i not in order[:m]]
        squares = {i: square(np.vstack([extra, stacked(candidates)[[*order[:m], i]]]), target) for i in left}
        assert min(squares, key=squares.__getitem__) == order[m]
        total = square(extra, target)
        errors.append(squares[order[m]] / len(target) + total / len(target) * (m + 2) / len(target))
    np.testing.assert_allclose([step.pse for step in model.steps], errors, rtol=1e-9)
    assert int(np.argmin(errors)) + 1 == len(index)


def test_twin_otter_side_force_and_yaw_need_no_nonlinear_terms(shared_data):
    """Flight f1_017: five linear candidates and seven products; both methods agree on the linear ones."""
    table = loadmat(shared_data / "sidpac" / "totter_f1_017_data.mat")["fdata"].T
    beta, aileron, rudder = np.deg2rad(table[[2, 14, 15]])
    p, r = table[70], table[72]
    candidates = {
        "beta": beta, "p": p, "r": r, "aileron": aileron, "rudder": rudder, "beta^2": beta**2,
        "beta rudder": beta * rudder, "beta aileron": beta * aileron, "p r": p * r, "beta^3": beta**3,
        "rudder^2": rudder**2, "aileron^2": aileron**2,
    }  # fmt: skip
    phi, names, constant = np.array(list(candidates.values())), list(candidates), np.ones((1, len(beta)))
    for column, expected in ((61, ("beta", "r", "rudder")), (65, ("beta", "rudder", "r", "p"))):
        chosen = stepwise(phi, table[column], names=names, nuisance=constant)
        functions = orthogonal_functions(phi, table[column], names=names, nuisance=constant)
        assert chosen.terms == functions.terms == expected
        assert chosen.fit is not None
        assert chosen.fit.r2[0] > 0.99
