"""How far two effects act in the same rows: closed forms on made-up changes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from freqid.gap.overlap import overlap

ROWS = ("actuator/de", "M", "Z")


def compared(**changes):
    """Return a manoeuvre of two lines whose noise has a standard deviation of 1, 2 and 4 in the rows."""
    record = SimpleNamespace(reference="u20", duration=60.0)
    return SimpleNamespace(
        signatures={f"{n}:size": np.outer(z, [1.0, 1j]) for n, z in changes.items()},
        common={},
        residual=np.zeros((3, 2), dtype=complex),
        rows=[SimpleNamespace(name=n) for n in ROWS],
        noise=SimpleNamespace(covariance=np.stack([np.diag([1.0, 4.0, 16.0])] * 2)),
        lines=SimpleNamespace(hz=np.array([0.5, 0.6]), inputs=("de",), owner=np.array([0, -1])),
        trial=SimpleNamespace(maneuver=SimpleNamespace(record=record)),
    )


def pair(one, other):
    evidence = SimpleNamespace(signatures=("a:size", "b:size"), tolerances=())
    best = SimpleNamespace(columns=(1, 2))
    return [SimpleNamespace(name="a+b", best=best, estimate=SimpleNamespace(value=(one, other)))], evidence


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1, 0, 0], [0, 2, 4], 0.0),
        ([1, 2, 4], [5, 10, 20], 1.0),
        ([1, 0, 0], [1, 2, 4], 3**-0.5),
        ([1, 2, 0], [0, 2, 4], 0.5),
    ],
)
def test_it_is_that_of_the_shares_by_row(a, b, expected):
    judged, evidence = pair(0.3, -7.0)
    assert overlap(judged, evidence, [compared(a=a, b=b)] * 2) == pytest.approx(expected)


def test_manoeuvres_count_by_their_energy():
    judged, evidence = pair(1.0, 1.0)
    flights = [compared(a=[1, 0, 0], b=[3, 0, 0]), compared(a=[0, 6, 0], b=[0, 2, 0])]
    # a has 1 and 9, b has 9 and 1
    assert overlap(judged, evidence, flights) == pytest.approx(2 * np.sqrt(0.09))


def test_without_a_pair_nothing_is_apart():
    assert overlap([SimpleNamespace(name="a")], None, []) == 1.0
