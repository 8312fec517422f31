"""A log without an effect, to which the effect is put back."""

from __future__ import annotations

import numpy as np
from linear_flight import LIBRARY, distorted, fly

from freqid.gap.clean_record import without


def test_a_log_without_an_effect_gives_the_log_with_it():
    clean = fly(noise=1.0).record
    for size in (0.03, -0.1):
        settings = {"scale": size}
        logged = distorted(settings, clean)
        found = without(LIBRARY["gyro"], settings, logged)
        reach = np.abs(clean["state/q"]).max()
        assert np.abs(found["state/q"] - clean["state/q"]).max() < 2 * abs(size) ** 4 * reach
        assert (found["state/w"] == clean["state/w"]).all()
    assert without(LIBRARY["worn"], {"share": 0.1}, clean) is clean
