"""Finalists weighed in full: exact where effects are straight lines, right where first order misleads."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import LIBRARY, SIZES, Linear, Truth, fly

from freqid.gap.attribute import judge
from freqid.gap.compare import compare, evidence_of
from freqid.gap.finalists import weighed_in_full
from freqid.simulate.effects import shipped

TOLERANT = {**SIZES, "derivatives": 0.02, "responses": 0.01, "dynamics": 0.05}


def judged(truth, library):
    flights = [fly(truth, noise=1.0, seed=s, phases=s, reference=f"u{s}") for s in (1, 2)]
    used = [
        compare(Linear(), m, library, TOLERANT, (0.1, 2.0), count=60, seed=k) for k, m in enumerate(flights)
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
