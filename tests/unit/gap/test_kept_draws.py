"""Draws kept from one diagnosis to the next: the same to the last bit, and never in the way."""

from __future__ import annotations

import os

import numpy as np
import pytest
from linear_flight import LIBRARY, TOLERANT, Linear, Truth, fly

from freqid.gap import kept_draws
from freqid.gap.compare import compare

COUNT = 30


def draw(seed):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((2, 3)) * (1 + 1j), rng.standard_normal((1, 3)) * (1 + 2j)


class Maker:
    """Makes draws, and counts how often."""

    def __init__(self):
        self.times = 0

    def __call__(self):
        self.times += 1
        return tuple(np.stack(parts) for parts in zip(draw(0), draw(1), strict=True))


def test_what_is_kept_is_what_was_made(tmp_path):
    make = Maker()
    made, again = (kept_draws.kept(tmp_path, draw(0), 2, 7, make) for _ in range(2))
    assert make.times == 1
    for a, b in zip(made, again, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("asked", [(draw(1), 2, 7), (draw(0), 3, 7), (draw(0), 2, 8)])
def test_other_draws_are_made(tmp_path, asked):
    make = Maker()
    kept_draws.kept(tmp_path, draw(0), 2, 7, make)
    kept_draws.kept(tmp_path, *asked, make)
    assert make.times == 2


@pytest.mark.parametrize("damage", [b"", b"no archive", None])
def test_a_damaged_file_is_made_again(tmp_path, damage):
    make = Maker()
    made = kept_draws.kept(tmp_path, draw(0), 2, 7, make)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-40] if damage is None else damage)
    again = kept_draws.kept(tmp_path, draw(0), 2, 7, make)
    assert make.times == 2
    np.testing.assert_array_equal(made[0], again[0])
    kept_draws.kept(tmp_path, draw(0), 2, 7, make)
    assert make.times == 2


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path):
    make, there = Maker(), tmp_path / "file"
    there.write_text("in the way")
    found = kept_draws.kept(there, draw(0), 2, 7, make)
    np.testing.assert_array_equal(found[0], make()[0])


def test_without_a_folder_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kept_draws.kept(None, draw(0), 2, 7, Maker())
    assert not list(tmp_path.iterdir())
    assert kept_draws.folder() == tmp_path / "freqid" / "draws"


def test_what_was_not_used_for_longest_goes(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_draws, "_MOST", 10**9)
    names = []
    for k in range(3):
        kept_draws.kept(tmp_path, draw(k), 2, 7, Maker())
        (new,) = {p.name for p in tmp_path.iterdir()} - set(names)
        os.utime(tmp_path / new, (k, k))
        names.append(new)
    kept_draws.kept(tmp_path, draw(0), 2, 7, Maker())  # used again: the second is now the oldest
    monkeypatch.setattr(kept_draws, "_MOST", 3 * (tmp_path / new).stat().st_size)
    kept_draws.kept(tmp_path, draw(3), 2, 7, Maker())
    left = {p.name for p in tmp_path.iterdir()}
    assert len(left) == 3
    assert left & set(names) == {names[0], names[2]}


def test_a_manoeuvre_compared_again_is_the_same_without_new_draws(tmp_path, monkeypatch):
    maneuver, asked = fly(Truth(loss=0.1), noise=1.0, seed=1, phases=1), []
    predict = Linear.predict
    monkeypatch.setattr(Linear, "predict", lambda *given: asked.append(1) or predict(*given))
    slightly_other = Linear(effects={"damping": {"extra": 1e-6}})
    found, times = [], []
    for simulation in (Linear(), Linear(), slightly_other):
        before = len(asked)
        found.append(
            compare(simulation, maneuver, LIBRARY, TOLERANT, (0.1, 2.0), count=COUNT, cache=tmp_path)
        )
        times.append(len(asked) - before)
    assert times == [times[0], times[0] - (COUNT - 1), times[0]]
    np.testing.assert_array_equal(found[0].draws, found[1].draws)
    np.testing.assert_array_equal(found[0].noise.whitening, found[1].noise.whitening)
