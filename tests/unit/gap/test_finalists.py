"""Finalists weighed in full: exact where effects are straight lines, right where first order misleads."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, Flying, Linear, Truth, fly, upright

from freqid.gap import finalists
from freqid.gap.attribute import judge
from freqid.gap.compare import compare
from freqid.gap.finalists import weighed_in_full
from freqid.gap.gather import evidence_of
from freqid.simulate.effects import shipped

TOLERANT = {**SIZES, "derivatives": 0.02, "responses": 0.01, "dynamics": 0.05}


def judged(truth, library, noise=1.0, flying=False):
    flights = [fly(truth, noise=noise, seed=s, phases=s, reference=f"u{s}") for s in (1, 2)]
    if flying:
        flights = [upright(flight) for flight in flights]
    used = [
        compare(Flying(phases=s) if flying else Linear(), m, library, TOLERANT, (0.1, 2.0), count=60, seed=s)
        for s, m in zip((1, 2), flights, strict=True)
    ]
    evidence = evidence_of(used)
    known = {i: e.of(flights[0].vehicle) for i, e in library.items()}
    first = judge(evidence, known)
    return first, weighed_in_full(first, evidence, known, used)


def of(found, name):
    return next(j for j in found if j.name == name)


def test_a_straight_line_is_weighed_as_it_was_to_first_order():
    first, full = judged(Truth(loss=0.15), LIBRARY)
    assert of(first, "worn").evidence > 10
    assert of(full, "worn").evidence == pytest.approx(of(first, "worn").evidence, rel=0.01)
    assert full[0].name == "worn"


@pytest.mark.parametrize("late", [0.06, 0.09])
def test_a_long_delay_is_not_taken_for_a_lag(late):
    """To first order a lag explains the curve that a delay's straight line leaves."""
    library = {i: shipped()[i] for i in ("actuator_delay", "actuator_lag", "rate_limit")}
    first, full = judged(Truth(late=late), library)
    delay = of(full, "actuator_delay")
    assert next(j for j in full if "+" not in j.name) is delay
    assert delay.evidence > of(full, "actuator_lag").evidence + 10
    assert delay.evidence > of(first, "actuator_delay").evidence
    (value,) = delay.settings["actuator_delay"].values()
    sigma = np.sqrt(delay.estimate.covariance[0, 0])
    assert value == pytest.approx(late, abs=3.3 * float(sigma))


def test_nothing_is_weighed_again_where_nothing_is_there():
    first, full = judged(Truth(), LIBRARY)
    assert [j.evidence for j in full] == [j.evidence for j in first]
    assert all(not j.settings for j in full)


def test_less_noise_is_no_explanation(monkeypatch):
    """A lighter aircraft scales the noise of what was measured: along the flight itself that gains 0.5."""
    monkeypatch.setattr(finalists, "LEAST_ODDS", -np.inf)
    first, full = judged(Truth(loss=0.15), LIBRARY, noise=4.0, flying=True)
    assert of(full, "heavy").evidence == pytest.approx(of(first, "heavy").evidence, abs=0.1)


def test_a_delay_and_a_lag_together_are_told_from_what_a_lag_alone_leaves():
    """About nothing a delay adds less to the lag than a rate limit does."""
    library = {
        i: shipped()[i] for i in ("actuator_delay", "actuator_lag", "rate_limit", "backlash", "sensor_bias")
    }
    first, full = judged(Truth(late=0.07, slow=0.1), library)
    assert {*full[0].name.split("+")} == {"actuator_delay", "actuator_lag"}
    assert full[0].settings["actuator_lag"]["extra"] == pytest.approx(0.1, abs=0.005)


def test_a_pair_sought_beside_both_of_its_effects_stands_once(monkeypatch):
    """Two fits that end at one size are one way for the pair to be there, not two."""
    library = {i: shipped()[i] for i in ("actuator_delay", "actuator_lag", "rate_limit", "backlash")}
    truth = Truth(late=0.05, slow=0.05)
    _, twice = judged(truth, library)
    monkeypatch.setattr(finalists, "_LEADING", 1)
    _, once = judged(truth, library)
    pairs = [frozenset(j.name.split("+")) for j in twice if "+" in j.name]
    assert len(pairs) == len(set(pairs))
    assert twice[0].evidence == pytest.approx(once[0].evidence, abs=0.1)
