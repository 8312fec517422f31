"""The check of channel arrays."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.identify.spectra.fourier import as_channels


def test_a_good_array_is_passed_on_without_a_copy():
    x = np.zeros((2, 5))
    assert as_channels(x) is x
    assert as_channels([[1, 2]]).dtype == float
    assert as_channels(x[:, ::2]).flags.c_contiguous


@pytest.mark.parametrize("shape", [(5,), (2, 3, 4), (2, 1)])
def test_shapes_that_are_refused(shape):
    with pytest.raises(UsageError, match="with 2 samples or more"):
        as_channels(np.zeros(shape), least=2)


def test_the_first_bad_sample_is_named():
    x = np.zeros((3, 4))
    x[2, 0] = np.nan
    x[1, 3] = -np.inf
    with pytest.raises(DataError, match="channel 1 is -inf at sample 3; repair"):
        as_channels(x)
