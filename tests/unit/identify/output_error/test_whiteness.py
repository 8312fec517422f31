"""Whiteness: false alarms at their rate, and colour found."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from freqid.identify.output_error.whiteness import coloured, white_probability, whiteness


def test_white_noise_is_called_coloured_as_seldom_as_it_says():
    rng = np.random.default_rng(0)
    probabilities = np.array([white_probability(rng.normal(size=500)) for _ in range(1000)])
    for level in (0.01, 0.05, 0.5):
        assert abs(np.mean(probabilities < level) - level) < 4 * np.sqrt(level * (1 - level) / 1000) + 0.02


def test_colour_is_found():
    rng = np.random.default_rng(1)
    residual = lfilter([1.0], [1.0, -0.3], rng.normal(size=(1, 1000)))[0]
    found = whiteness(["a", "b"], [np.stack([residual, rng.normal(size=1000)], axis=1)])
    assert coloured(found) == ("a",)


def test_a_residual_of_zeros_is_white():
    assert white_probability(np.zeros(100)) == 1.0
