"""Each row has its own error of form: the data choose it, and where they say nothing there is none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.gap.infer.build import _smallest_likely
from freqid.gap.infer.system import Form


def evidence(log):
    """Return an evidence with log weights at errors of 0, 0.1, 0.2 and 0.4."""
    weights = np.exp(np.array(log) - np.max(log))
    forms = tuple(Form(f, 0.0) for f in (0.0, 0.1, 0.2, 0.4))
    return SimpleNamespace(form_weights=lambda: weights, system=SimpleNamespace(form_errors=forms))


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        ((0.0, 0.0, 0.01, 0.02), 0.0),  # nothing moves
        ((-30.0, -4.0, -0.5, 0.0), 0.2),  # hardly less likely than the likeliest
        ((-30.0, -9.0, -2.0, 0.0), 0.4),
        ((-1500.0, -1.1, 0.0, -800.0), 0.2),
    ],
)
def test_the_smallest_error_that_is_hardly_less_likely_is_taken(log, expected):
    assert _smallest_likely(evidence(log)) == expected
