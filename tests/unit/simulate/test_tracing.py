"""Traced forms that are stored: read back as they were, and as good as none where they are not whole."""

from __future__ import annotations

import hashlib
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.simulate import effects, tracing
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.motion.actuators import Commands


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tracing, "_FOLDER", tmp_path / "traces")
    return tmp_path / "traces"


class Traced:
    """A function that counts how often it is traced."""

    def __init__(self):
        self.count = 0

    def fresh(self):
        """Return it as a fresh process would have it."""

        def turn(commands, scale):
            self.count += 1
            told = {"all": jnp.concatenate(commands), "none": None}
            return Commands(*(scale * jnp.sin(x) for x in commands)), [told, (scale,)]

        return tracing.stored(turn)


def commands(surfaces=3):
    return Commands(np.linspace(0.1, 0.4, surfaces), np.array([0.5]), np.array([100.0, 200.0]))


def same(one, other):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    assert all(np.array_equal(x, y) for x, y in zip(*map(jax.tree.leaves, (one, other)), strict=True))


def test_another_process_reads_what_the_first_one_traced(folder):
    traced = Traced()
    first = traced.fresh()(commands(), 2.0)
    turned, (told, scale) = traced.fresh()(commands(), 2.0)
    assert traced.count == 1
    same((turned, [told, scale]), first)
    assert isinstance(turned, Commands)
    assert told["none"] is None
    np.testing.assert_allclose(turned.speed, 2 * np.sin([100.0, 200.0]), rtol=1e-14)
    np.testing.assert_array_equal(told["all"], np.concatenate(commands()))
    assert scale == (2.0,)


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-1],
        lambda content: content[:400] + bytes([content[400] ^ 1]) + content[401:],
        lambda content: (lambda form: hashlib.sha256(form).hexdigest().encode() + form)(
            b"of another release"
        ),
    ],
    ids=["empty", "cut off", "one bit", "right checksum, other contents"],
)
def test_what_cannot_be_used_is_as_good_as_none(folder, damage):
    traced = Traced()
    first = traced.fresh()(commands(), 2.0)
    (path,) = folder.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    same(traced.fresh()(commands(), 2.0), first)
    assert traced.count == 2


def test_damaged_form_is_replaced(folder):
    traced = Traced()
    traced.fresh()(commands(), 2.0)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    traced.fresh()(commands(), 2.0)
    traced.fresh()(commands(), 2.0)
    assert traced.count == 2
    assert [p.name for p in folder.iterdir()] == [path.name]


def test_folder_that_cannot_be_written_is_no_error(folder):
    folder.write_text("a file has its name")
    traced = Traced()
    turned, _ = traced.fresh()(commands(), 2.0)
    np.testing.assert_allclose(turned.tilt, 2 * np.sin([0.5]), rtol=1e-14)


def test_form_goes_with_structure_shapes_types_and_code(folder, monkeypatch):
    traced = Traced()
    traced.fresh()(commands(), 2.0)
    traced.fresh()(commands(surfaces=4), 2.0)
    traced.fresh()(tuple(commands()), 2.0)
    traced.fresh()(commands(), np.float32(2.0))
    assert traced.count == 4
    monkeypatch.setattr(tracing, "_release", lambda: "another release")
    traced.fresh()(commands(), 2.0)
    assert traced.count == 5
    assert len(os.listdir(folder)) == 5


def test_users_own_effects_are_traced_every_time(folder, monkeypatch):
    mine = Effect("mine", "sensor", "a test", {"size": Parameter(0.0, "1", "size")}, distort=lambda s, r: r)
    monkeypatch.setattr(effects, "_added", {"mine": mine})
    traced = Traced()
    traced.fresh()(commands(), 2.0)
    traced.fresh()(commands(), 2.0)
    assert traced.count == 2
    assert not folder.exists()


def test_errors_in_tracing_are_those_of_the_function(folder):
    @tracing.stored
    def wrong(x):
        raise ValueError("the function's own")

    with pytest.raises(ValueError, match="the function's own"):
        wrong(np.zeros(2))
