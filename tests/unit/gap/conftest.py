"""Flights of the linear aircraft beside its simulation, for more than one kind of test."""

from __future__ import annotations

import pytest
from linear_flight import LIBRARY, TOLERANT, Linear, Truth, fly

from freqid.gap.compare import compare


@pytest.fixture(scope="session")
def compared():
    """Compare the simulation with flights of a truth, of one reference and one set of phases each."""

    def of(truth, seeds, tolerances=TOLERANT):
        flights = [fly(truth, noise=1.0, seed=s, phases=s, reference=f"u{s}") for s in seeds]
        return [
            compare(Linear(), m, LIBRARY, tolerances, (0.1, 2.0), count=60, seed=s)
            for s, m in zip(seeds, flights, strict=True)
        ]

    return of


@pytest.fixture(scope="session")
def worn(compared):
    """Two flights of an aircraft with a worn surface, and a third one that is kept."""
    return compared(Truth(loss=0.15), (1, 2)), compared(Truth(loss=0.15), (3,))
