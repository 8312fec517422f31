"""Work on several items at once: in order, and as the caller wants numpy's warnings."""

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.gap.simulation import side_by_side


@pytest.mark.parametrize("kind", ["scenario", "callable"])
def test_results_stand_in_order_and_overflow_is_as_the_caller_wants_it(kind):
    simulation = SimpleNamespace(kind=kind)
    with np.errstate(over="ignore"):  # a warning would be an error here
        found = side_by_side(simulation, lambda x: np.float64(x) * 1e308, [0.5, 100.0])
    assert found == [5e307, np.inf]
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        side_by_side(simulation, lambda x: np.float64(x) * 1e308, [0.5, 100.0])
