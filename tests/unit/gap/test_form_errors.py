"""Each row has its own error of form, as its data have it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.gap.infer.build import _average
from freqid.gap.infer.system import Form


def evidence(log):
    """Return an evidence with log weights at errors of 0, 0.1, 0.2 and 0.4."""
    weights = np.exp(np.array(log) - np.max(log))
    weights = weights / weights.sum()
    forms = tuple(Form(f, 0.0) for f in (0.0, 0.1, 0.2, 0.4))
    return SimpleNamespace(form_weights=lambda: weights, system=SimpleNamespace(form_errors=forms))


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        ((-30.0, -40.0, -30.0, 0.0), 0.4),  # one size alone
        ((-1500.0, 0.0, 0.0, -800.0), np.sqrt((0.1**2 + 0.2**2) / 2)),
        # none with an effect is as likely as some without: it may not be taken for none
        ((0.0, -20.0, 0.0, -20.0), np.sqrt(0.2**2 / 2)),
    ],
)
def test_the_error_of_a_row_has_the_variance_of_all_sizes_together(log, expected):
    assert _average(evidence(log)) == pytest.approx(expected, rel=1e-6)
