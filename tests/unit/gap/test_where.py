"""Where a gap is: what is detectable of it in each cell beside all that is unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import LIBRARY, Linear, Truth, fly
from scipy.linalg import block_diag

from freqid.core.results.gap import GapMap
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.where import gap_map
from freqid.gap.model.tolerance import record_columns, stated

QUESTION = Question(
    LIBRARY, stated({"derivatives": 0.02, "dynamics": 0.02}, LIBRARY), (0.05, 2.0), draws=400, close=False
)


def real(block, z):
    """Return spectra as the real numbers of all rows in one vector."""
    return block.lines.real(z).ravel()


def noise(block):
    """Return the covariance of those numbers, from that of complex spectra."""
    rows, count = len(block.rows), block.lines.hz.size
    found = np.zeros((rows, 2 * count - 1, rows, 2 * count - 1))
    for k, c in enumerate(block.covariance):
        found[:, k, :, k] = c.real
        if k:
            imaginary = k + count - 1
            found[:, imaginary, :, imaginary] = c.real
            found[:, k, :, imaginary], found[:, imaginary, :, k] = -c.imag, c.imag
    return found.reshape(rows * (2 * count - 1), -1)


def sized(worn, share):
    """Return errors of form of one share in all terms, half of it in all conditions alike."""
    return Form((share,) * len(worn.columns[0].form_names), 0.5)


def form(block, columns, size):
    """Return errors of form as they are before whitening: of the block alone, and those all blocks share."""
    count = len(block.rows) * (2 * block.lines.hz.size - 1)
    whitening = np.zeros((count, count))
    for k, unit in enumerate(np.eye(count)):
        whitening[:, k] = block.white(block.lines.complex(unit.reshape(len(block.rows), -1)))
    return [np.linalg.solve(whitening, f.T) for f in columns.form_at(size)]


@pytest.fixture(scope="module")
def worn():
    flights = [
        fly(Truth(loss=0.1), noise=1.0, duration=40.0, seed=s, phases=s, reference=f"r{s}") for s in (1, 2)
    ]
    return diagnose(Linear(), flights, QUESTION)


def test_parts_are_those_of_the_detectability_by_a_dense_covariance(worn):
    size = sized(worn, 0.02)
    s = np.concatenate([real(b, z) for b, z in zip(worn.blocks, worn.explained, strict=True)])
    own = [record_columns(b, LIBRARY, QUESTION.tolerances).values() for b in worn.blocks]
    S = block_diag(
        *(sum(np.outer(v, v) for v in (real(b, z) for z in o)) for b, o in zip(worn.blocks, own, strict=True))
    )
    T = np.array(
        [
            np.concatenate([real(b, c.sigmas[k]) for b, c in zip(worn.blocks, worn.columns, strict=True)])
            for k in range(len(worn.system.tolerances))
        ]
    )
    S += T.T @ T
    F, shared = zip(*(form(b, c, size) for b, c in zip(worn.blocks, worn.columns, strict=True)), strict=True)
    assert F[0].size
    S += block_diag(*(f @ f.T for f in F))
    S += np.concatenate(shared) @ np.concatenate(shared).T
    S += block_diag(*(noise(b) for b in worn.blocks))
    each = (s * np.linalg.solve(S, s)).reshape(2, len(worn.blocks[0].rows), -1)
    expected = each.sum(axis=2)
    found = gap_map(worn.blocks, worn.columns, [worn.explained], size).detectability
    np.testing.assert_allclose(found.sum(axis=(1, 3)).T, expected / expected.sum(), rtol=1e-6, atol=1e-6)


def test_a_weak_elevator_is_in_pitch_on_its_own_lines(worn):
    first = worn.diagnosis.where[0]
    assert (first.response, first.input) == ("M", "d1")


def test_where_a_tolerance_may_do_the_same_little_is_seen_however_much_is_there(worn):
    """The surface's derivatives of pitch may be anything: what remains is in the other loads."""
    free = np.ones(len(worn.system.tolerances))
    free[worn.system.tolerances.index("derivatives.M.d1")] = 1e3
    columns = [replace(c, tolerances=free[:, None] * c.tolerances) for c in worn.columns]
    pitch = worn.map.rows.index("M")
    before, after = (
        gap_map(worn.blocks, c, [worn.explained], sized(worn, 0.0)).shares(1, 2, 3)
        for c in (worn.columns, columns)
    )
    assert before[pitch] > 0.5 * before.sum()
    assert after[pitch] < 0.05 * after.sum()


def test_where_an_error_of_form_may_do_the_same_little_is_seen(worn):
    """Pitch may be off in form by any share: what remains is in the other loads."""
    names = worn.columns[0].form_names
    pitch, share = worn.map.rows.index("M"), [float(n.startswith("M")) for n in names]
    assert 0 < sum(share) < len(share)
    after = gap_map(worn.blocks, worn.columns, [worn.explained], Form(tuple(share), 0.0)).shares(1, 2, 3)
    assert after[pitch] < 0.2 * after.sum()


def test_each_of_two_effects_counts_alike_however_large_it_is(worn):
    """One of them a hundred times as large, in Z; the other in M."""

    def alone(row, size):
        made = [np.zeros_like(z) for z in worn.explained]
        for block, z in zip(worn.blocks, made, strict=True):
            i = [r.name for r in block.rows].index(row)
            z[i] = size * np.sqrt(block.noise_power[i])
        return made

    effects = [alone("M", 1.0), alone("Z", 100.0)]
    shares = gap_map(worn.blocks, worn.columns, effects, sized(worn, 0.0)).share("row")
    assert shares["M"] == pytest.approx(0.5, abs=0.05)
    assert shares["Z"] == pytest.approx(0.5, abs=0.05)


def a_map(parts):
    """Return a map of rows by signals in the second of three bands; `parts` has the mean last."""
    rows, inputs = ("M", "N", "X"), ("a", "b", "c", "")
    detectability = np.zeros((3, 3, 1, 4))
    detectability[:, 1, 0] = parts
    bands = ((0.0, 0.1), (0.1, 0.5), (0.5, 2.0))
    return GapMap(rows, ("u30",), inputs, bands, detectability, np.zeros((3, 3)))


def listed(cells):
    return [(p.response, p.input, round(p.share, 3)) for p in cells.places()]


def test_a_row_is_listed_by_the_signals_that_hold_a_tenth_of_the_gap_and_of_the_row():
    """N's signal c holds a tenth of N alone, M's signal b a tenth of the gap alone."""
    cells = a_map([[0.5, 0.04, 0.0, 0.01], [0.0, 0.3, 0.05, 0.02], [0.0, 0.0, 0.0, 0.08]])
    assert listed(cells) == [("M", "a", 0.5), ("N", "b", 0.3), ("N", "", 0.07)]
    assert cells.places()[0].band_hz == (0.1, 0.5)


def test_what_is_listed_of_a_row_is_nine_tenths_of_it_or_more():
    rng = np.random.default_rng(7)
    for _ in range(50):
        cells = a_map(rng.exponential(size=(3, 4)) ** 3)
        rows = cells.share("row")
        assert set(rows) >= {p.response for p in cells.places()}
        for name, share in rows.items():
            sum_of = sum(p.share for p in cells.places() if p.response == name)
            assert sum_of >= 0.9 * share - 1e-12 if share >= 0.1 else sum_of == 0


def test_a_row_of_many_small_signals_has_one_place_and_no_signal():
    inputs, shares = (*"abcdefghijkl", ""), np.full((1, 1, 1, 13), 1 / 13)
    many = GapMap(("M",), ("u30",), inputs, ((0.0, 1.0),), shares, np.zeros((1, 3)))
    assert listed(many) == [("M", "", 1.0)]


def test_a_band_is_the_narrowest_that_holds_most():
    cells = a_map(np.zeros((3, 4)))
    cells.detectability[0, :, 0, 0] = (0.3, 0.25, 0.45)
    assert cells.band_of("M") == (0.1, 2.0)
    assert cells.places()[0].band_hz == (0.1, 2.0)
