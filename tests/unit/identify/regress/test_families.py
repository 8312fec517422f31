"""Terms that enter together: many small ones, none of noise, and none twice."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.identify.regress.structure import (
    CHANCE,
    enter_families,
    partial_f_of_all,
    prepare_candidates,
    stepwise,
)

SIZE, LINES = 12, 100
FAMILIES = [list(range(SIZE)), list(range(SIZE, 2 * SIZE))]


def problem(seed, truth):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((2 * SIZE, LINES, 2)) @ [1.0, 1j]
    noise = rng.standard_normal((LINES, 2)) @ [1.0, 1j]
    return prepare_candidates(x, truth @ x + noise, None, None, 1.0), x, truth @ x + noise


def test_many_small_terms_enter_where_each_alone_is_not_seen():
    """Each of twelve explains a fortieth of the response; together they explain a third of it."""
    truth = np.concatenate([np.full(SIZE, 0.25), np.zeros(SIZE)])
    found = [enter_families(problem(seed, truth)[0], FAMILIES, 4.0) for seed in range(20)]
    singly = [enter_families(problem(seed, truth)[0], [], 4.0) for seed in range(20)]
    assert np.mean([len(set(terms) & set(range(SIZE))) for terms in found]) > 9
    assert np.mean([len(terms) for terms in singly]) < 6
    assert np.mean([len(set(terms) - set(range(SIZE))) for terms in found]) < 0.1


def test_noise_enters_by_chance_only():
    """26 groups at 5e-5 each: 0.5 flights in 400, more than 5 with a probability of 2e-5."""
    entered = [bool(enter_families(problem(s, np.zeros(2 * SIZE))[0], FAMILIES, 4.0)) for s in range(400)]
    assert 26 * CHANCE * 400 < 1
    assert sum(entered) <= 5


def test_nothing_more_enters_once_enough_is_explained():
    truth = np.zeros(2 * SIZE)
    truth[:3] = 100.0, 10.0, 5.0
    candidates = problem(0, truth)[0]
    whole = candidates.residual_square([])
    assert enter_families(candidates, [], 4.0, enough=0.1 * whole) == [0]
    assert enter_families(candidates, [], 4.0)[:3] == [0, 1, 2]


def test_final_f_is_that_of_a_model_with_and_without_the_term():
    truth = np.concatenate([np.full(4, 1.0), np.zeros(2 * SIZE - 4)])
    candidates, x, z = problem(3, truth)
    f = partial_f_of_all(candidates, [0, 1, 2])

    def left(rows):
        a, b = (np.hstack([v.real, v.imag]) for v in (x[rows], z))
        return float(np.sum((b - np.linalg.lstsq(a.T, b, rcond=None)[0] @ a) ** 2))

    stays = (left([0, 2]) - left([0, 1, 2])) / (left([0, 1, 2]) / (2 * LINES - 3))
    enters = (left([0, 1, 2]) - left([0, 1, 2, 7])) / (left([0, 1, 2, 7]) / (2 * LINES - 4))
    assert f[1] == pytest.approx(stays, rel=1e-9)
    assert f[7] == pytest.approx(enters, rel=1e-9)


def test_from_everything_many_weak_terms_stay_that_from_nothing_are_never_seen():
    """Sixty terms alike: each alone explains a sixtieth, which beside the rest of the response is chance."""
    rng = np.random.default_rng(5)
    x = rng.standard_normal((60, 60, 2)) @ [1.0, 1j]
    z = x.sum(axis=0) + 0.3 * rng.standard_normal((60, 2)) @ [1.0, 1j]
    assert len(stepwise(x, z, f_enter=10.0).terms) < 10
    whole = stepwise(x, z, f_enter=10.0, start="everything")
    assert len(whole.terms) == 60
    assert min(whole.partial_f.values()) > 10.0
