"""Refits and closures, and where a gap is, on flights of an aircraft that has the effect."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, Linear, Truth, fly, motion

from freqid.gap.close import Misfit, misfit
from freqid.gap.compare import compare
from freqid.gap.locate import coherence, gap_map
from freqid.gap.refit import refit

TOLERANT = {**SIZES, "derivatives": 0.02, "responses": 0.01, "dynamics": 0.02}


def compared(truth, seeds, noise=1.0):
    flights = [fly(truth, noise=noise, seed=s, phases=s, reference=f"u{s}") for s in seeds]
    return [
        compare(Linear(), m, LIBRARY, TOLERANT, (0.1, 2.0), count=60, seed=s)
        for s, m in zip(seeds, flights, strict=True)
    ]


@pytest.fixture(scope="module")
def worn():
    return compared(Truth(loss=0.15), (1, 2)), compared(Truth(loss=0.15), (3,))


@pytest.fixture(scope="module")
def sound():
    return compared(Truth(), (1, 2))


def test_a_refit_finds_the_size_within_its_standard_error(worn):
    found = refit(worn[0], [LIBRARY["worn"]], {"worn": {"share": 0.05}})
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert abs(found.value[0] - 0.15) < 3.3 * sigma
    assert sigma < 0.03
    assert found.settings == {"worn": {"share": float(found.value[0])}}
    assert found.at_bound == ()
    assert found.undetermined == ()


def test_what_an_effect_may_be_off_by_is_part_of_its_refit(worn):
    """A tolerance of the very parameter would widen its interval by as much; that of a derivative stays."""
    flights = [fly(Truth(loss=0.15), noise=1.0, seed=s, phases=s, reference=f"u{s}") for s in (1, 2)]
    tolerant = [
        compare(Linear(), m, LIBRARY, {**TOLERANT, "worn": 0.05}, (0.1, 2.0), count=60, seed=s)
        for s, m in zip((1, 2), flights, strict=True)
    ]
    assert "tolerance:worn:share" in tolerant[0].common
    start = {"worn": {"share": 0.1}}
    with_it, without = (refit(used, [LIBRARY["worn"]], start) for used in (tolerant, worn[0]))
    assert with_it.value[0] == pytest.approx(without.value[0], rel=1e-6)
    assert with_it.covariance == pytest.approx(without.covariance, rel=1e-6)


def test_a_large_effect_is_told_by_the_flight_that_it_moved():
    """The simulation's own flight, of which signatures are, has next to none of the gap's motion."""

    @dataclass(frozen=True, eq=False)
    class Flying(Linear):
        phases: int = 1

        def fly(self, record, effects=None):
            alone = motion(Truth(), 20.0, 20.0, self.phases)
            return {n: x for n, x in alone.items() if n.startswith(("state/", "effector/"))}

    used = []
    for s in (1, 2):
        flight = fly(Truth(drag=4.0), noise=1.0, seed=s, phases=s)
        still = [
            replace(flight.record.channel(f"state/{n}"), values=0 * flight.record.time) for n in ("p", "r")
        ]
        flight = replace(flight, record=flight.record.with_channels(*still))
        used.append(compare(Flying(phases=s), flight, LIBRARY, SIZES, (0.1, 2.0), count=60, seed=s))
    drag = LIBRARY["drag"]
    moved = [np.std(c.smoothed.record["state/u"] - c.trial.maneuver.record["state/u"]) for c in used]
    assert min(moved) > 0.2 * np.std(used[0].maneuver.record["state/u"])
    found = refit(used, [drag], {"drag": {"factor": 1.0}})
    assert found.value[0] == pytest.approx(4.0, abs=3.3 * float(np.sqrt(found.covariance[0, 0])))
    assert misfit(used, [drag], found.settings).share(0.9).G > 0.95


def test_a_delay_is_found_though_it_is_no_straight_line():
    used = compared(Truth(late=0.04), (1, 2))
    found = refit(used, [LIBRARY["late"]], {"late": {"by": 0.0}})
    assert found.value[0] == pytest.approx(0.04, abs=max(3.3 * float(np.sqrt(found.covariance[0, 0])), 1e-4))


def test_a_refit_that_stops_at_a_bound_says_so(worn):
    effect = LIBRARY["worn"]
    narrow = replace(effect, parameters={"share": replace(effect.parameters["share"], high=0.08)})
    found = refit(worn[0], [narrow], {"worn": {"share": 0.0}})
    assert found.value[0] == 0.08
    assert found.at_bound == (("worn", "share"),)


def test_a_parameter_that_does_nothing_here_is_not_determined(worn):
    idle = replace(LIBRARY["drag"], id="idle", replay=lambda settings, replay: np.zeros((6, 1001)))
    found = refit(worn[0], [LIBRARY["worn"], idle], {"worn": {"share": 0.1}, "idle": {"factor": 0.2}})
    assert found.undetermined == (("idle", "factor"),)
    assert found.value[0] == pytest.approx(0.15, abs=0.03)


def test_the_true_effect_closes_the_gap_where_it_was_not_fitted(worn):
    used, kept = worn
    settings = refit(used, [LIBRARY["worn"]], {"worn": {"share": 0.1}}).settings
    share = misfit(kept, [LIBRARY["worn"]], settings).share(0.9)
    assert share.G > 0.95
    assert share.lo <= share.G <= share.hi
    assert share.hi - share.lo < 0.2


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
