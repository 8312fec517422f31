"""What the pictures of a diagnosis are drawn from."""

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.gap.shown import _beside, _history, _terms, named
from freqid.gap.stack.lines import Lines


def test_a_condition_is_named_by_its_first_record_and_its_repeats():
    assert named(SimpleNamespace(names=("a.h5",))) == "a.h5"
    assert named(SimpleNamespace(names=("a.h5", "b.h5"))) == "a.h5 and 1 repeat"
    assert named(SimpleNamespace(names=("a.h5", "b.h5", "c.h5"))) == "a.h5 and 2 repeats"


def test_a_history_is_what_its_lines_are_the_transform_of():
    time = np.arange(501) / 25  # 20 s
    signal = 3.0 + np.sin(2 * np.pi * 0.35 * time) - 0.5 * np.cos(2 * np.pi * 0.8 * time)
    lines = Lines(np.arange(41) / 20, 1 / 25, time.size, (), np.full(41, -1))
    z = lines.spectrum(signal[None])
    np.testing.assert_allclose(_history(SimpleNamespace(lines=lines), z, time)[0], signal, atol=1e-6)


def test_terms_are_those_of_loads_by_the_inputs_they_go_with():
    labels = ("X:0", "X:1", "M:1", "actuator/de:0", "actuator/de out of phase:0")
    found = _terms(labels, ["X", "M"], ("state/u", "effector/de"))
    assert found == [(0, "X", "u"), (1, "X", "de"), (2, "M", "de")]


def test_tolerances_are_integrated_out_as_a_dense_covariance_does_it():
    rng = np.random.default_rng(0)
    X, T, r = rng.normal(size=(2, 40)), rng.normal(size=(3, 40)), rng.normal(size=40)
    every = np.concatenate([X, T, r[None]])
    G, g = _beside(every @ every.T, [0, 1], [2, 3, 4])
    S = np.eye(40) + T.T @ T
    np.testing.assert_allclose(G, X @ np.linalg.solve(S, X.T))
    assert g == pytest.approx(X @ np.linalg.solve(S, r))
