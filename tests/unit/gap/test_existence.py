"""From which statistic on a gap is called: draws and odds both have to speak for it."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.gap.infer.null_draws import threshold_of

LEVEL = 0.02


def test_odds_bound_the_threshold_where_draws_hardly_vary():
    quiet = np.linspace(-2.0, 0.5, 1000)
    found = threshold_of(quiet, LEVEL)
    assert 1 / (1 + np.exp(found)) == pytest.approx(LEVEL)


def test_draws_bound_it_where_the_model_itself_gives_more():
    loud = np.linspace(-2.0, 10.0, 1001)
    found = threshold_of(loud, LEVEL)
    assert np.mean(loud > found) == pytest.approx(LEVEL, abs=0.002)
    assert found > threshold_of(loud, 0.1)
