"""Closures, and where a gap is, on flights of an aircraft that has the effect."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import LIBRARY, MASS, TOLERANT, Flying, Truth, fly, upright

from freqid.gap.close import Misfit, misfit
from freqid.gap.compare import compare
from freqid.gap.locate import coherence, gap_map
from freqid.gap.refit import refit


@pytest.fixture(scope="module")
def sound(compared):
    return compared(Truth(), (1, 2))


def test_the_true_effect_closes_the_gap_where_it_was_not_fitted(worn):
    used, kept = worn
    settings = refit(used, [LIBRARY["worn"]], {"worn": {"share": 0.1}}).settings
    share = misfit(kept, [LIBRARY["worn"]], settings).share(0.9)
    assert share.G > 0.95
    assert share.lo <= share.G <= share.hi
    assert share.hi - share.lo < 0.2


def test_a_mass_error_closes_a_gap_though_it_scales_the_noise_of_what_was_measured():
    """Along the flight itself its change holds the residual's own noise: G of a right mass was 0.25."""
    used, kept = (
        [
            compare(
                Flying(phases=s),
                upright(fly(Truth(mass=1.15 * MASS), noise=4.0, seed=s, phases=s)),
                LIBRARY,
                TOLERANT,
                (0.1, 2.0),
                count=60,
                seed=s,
            )
            for s in seeds
        ]
        for seeds in ((1, 2), (3, 4))
    )
    heavy = [LIBRARY["heavy"]]
    found = refit(used, heavy, {"heavy": {"fraction": 0.1}})
    assert found.value[0] == pytest.approx(0.15, abs=2 * float(np.sqrt(found.covariance[0, 0])))
    assert misfit(kept, heavy, found.settings).share(0.9).G > 0.9


def test_another_effect_closes_little_and_a_wrong_one_makes_it_worse(worn):
    used, kept = worn
    drag = [LIBRARY["drag"]]
    settings = refit(used, drag, {"drag": {"factor": 0.1}}).settings
    assert misfit(kept, drag, settings).share(0.9).G < 0.4
    backwards = misfit(kept, [LIBRARY["worn"]], {"worn": {"share": -0.15}}).share(0.9)
    assert backwards.G < -1
    nothing = misfit(kept, [LIBRARY["worn"]], {"worn": {"share": 0.0}}).share(0.9)
    assert abs(nothing.G) < 1e-9


def test_half_an_effect_closes_three_quarters(worn):
    """Squares: what is left of a gap is half as large."""
    half = misfit(worn[1], [LIBRARY["worn"]], {"worn": {"share": 0.075}}).share(0.9)
    assert 0.68 < half.G < 0.82


def test_without_a_gap_there_is_nothing_to_close(sound):
    share = misfit(sound, [LIBRARY["worn"]], {"worn": {"share": 0.01}}).share(0.9)
    assert np.isnan(share.G)
    assert "noise" in share.why_undefined


def test_misfits_of_folds_add_up(worn):
    parts = [misfit([c], [LIBRARY["worn"]], {"worn": {"share": 0.15}}) for c in worn[0]]
    whole = Misfit.pooled(parts)
    assert whole.before == pytest.approx(sum(p.before for p in parts))
    assert whole.after == pytest.approx(sum(p.after for p in parts))
    assert whole.share(0.9).G > 0.95


def test_a_gap_is_found_in_the_cell_that_it_was_put_in(sound):
    c = sound[1]
    names = [r.name for r in c.rows]
    inside = (c.lines.hz > 0.5) & (c.lines.hz <= 1.0) & (c.lines.owner == 0)
    change = [np.zeros_like(x.residual) for x in sound]
    change[1][names.index("M"), inside] = 0.3
    found = gap_map(sound, change)
    for axis, cell in (("row", "M"), ("band", "0.5-1 Hz"), ("regime", "u2"), ("input", "d1")):
        shares = found.share(axis)
        assert next(iter(shares)) == cell
        assert shares[cell] == pytest.approx(1.0)
        assert sum(shares.values()) == pytest.approx(1.0)
    (place,) = found.places()
    assert (place.response, place.band_hz, place.regime, place.input) == ("M", (0.5, 1.0), "u2", "d1")
    assert place.share == pytest.approx(1.0)
    # energy is counted in units of noise
    expected = (0.3**2 / c.noise.covariance[inside, 2, 2].real).sum()
    assert found.energy.sum() == pytest.approx(expected)


def test_a_burst_is_in_its_third_of_the_manoeuvre(sound):
    c = sound[0]
    time = c.maneuver.record.time
    burst = np.exp(-0.5 * ((time - 17.0) / 0.8) ** 2) * np.sin(2 * np.pi * time)
    values = np.zeros((len(c.rows), time.size))
    values[1] = burst
    found = gap_map([c], [c.lines.spectrum(values)])
    assert found.places()[0].phase == "last third"
    assert found.phase[1].sum() == pytest.approx(1.0)
    assert gap_map([c], [0 * c.residual]).places() == []


def test_coherence_is_with_the_signal_that_makes_the_gap(worn, sound):
    gap, none = coherence(worn[0]), coherence(sound)
    assert gap["M"]["d1"] > 0.95
    assert none["M"]["d1"] < 0.5
    assert all(0 <= x <= 1 for row in gap.values() for x in row.values())
