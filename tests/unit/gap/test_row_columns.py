"""Columns of one row each have the inner products of the same columns whitened in full."""

import numpy as np
import pytest

from freqid.gap.model.row_columns import RowColumns
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.noise import whitening_of

ROWS, LINES = 4, 7
LINE = Lines(np.arange(LINES) / 10.0, 0.1, 101, (), np.full(LINES, -1), 0)


@pytest.fixture(scope="module")
def spread():
    """Columns, and what they are once each is whitened line by line."""
    rng = np.random.default_rng(4)
    z = rng.standard_normal((2, LINES, ROWS, 2 * ROWS)) * [[[[1.0]]], [[[0.6]]]]
    z[1, 0] = 0.0  # the zero line is real
    noise = z[0] + 1j * z[1]
    whitening = whitening_of(noise @ noise.conj().swapaxes(1, 2))
    row = np.array([2, 0, 0, 3, 1, 2])
    spectra = rng.standard_normal((len(row), LINES)) + 1j * rng.standard_normal((len(row), LINES))
    full = np.zeros((len(row), ROWS, LINES), dtype=complex)
    full[np.arange(len(row)), row] = LINE.complex(LINE.real(spectra))
    white = np.einsum("lij,kjl->kil", whitening, full)
    seen = np.ones(2 * LINES - 1, dtype=bool)
    return RowColumns(row, LINE.real(spectra), whitening, LINE, seen), LINE.real(white)


def test_whitened_columns_are_those_of_each_line(spread):
    columns, white = spread
    np.testing.assert_allclose(columns.white(), white.reshape(len(white), -1), atol=1e-12)


def test_products_are_those_of_whitened_columns(spread):
    columns, white = spread
    white = white.reshape(len(white), -1)
    others = np.random.default_rng(5).standard_normal((9, white.shape[1]))
    np.testing.assert_allclose(columns.across(others), white @ others.T, atol=1e-12)
    np.testing.assert_allclose(columns.gram(), white @ white.T, atol=1e-12)


def test_some_columns_on_some_lines_have_the_products_there(spread):
    columns, white = spread
    kept = np.concatenate([[0], *(np.arange(1, LINES),) * 2]) % 2 == 1
    chosen = np.array([True, False, True, True, False, True])
    few = columns.some(chosen).only(kept)
    part = white[chosen][..., kept].reshape(4, -1)
    others = np.random.default_rng(6).standard_normal((3, part.shape[1]))
    np.testing.assert_allclose(few.white(), part, atol=1e-12)
    np.testing.assert_allclose(few.across(others), part @ others.T, atol=1e-12)
    np.testing.assert_allclose(few.gram(), part @ part.T, atol=1e-12)
