"""Anywhere in and off the envelope: the place is the nearest one, and results are finite."""

import numpy as np
import pytest
import tilt_wing
from hypothesis import given, settings
from hypothesis import strategies as st

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up

SPEEDS = (0.0, 2.0, 5.0, 9.0, 13.0, 18.0, 25.0)
MODEL = GlobalModel(
    line_up([tilt_wing.exact_point(tilt_wing.trim(u, 1.225), f"{u:g}") for u in SPEEDS], "abcdefg")
)
DENSE = np.linspace(0.0, 25.0, 20001)
TILTS = MODEL.lines[0].schedule(DENSE)
angles = st.floats(-0.3, 2.0)


@settings(max_examples=150)
@given(speed=st.floats(-5.0, 40.0), front=angles, apart=st.floats(-0.2, 0.2))
def test_the_place_is_the_nearest_there_is(speed, front, apart):
    tilt = np.array([[front], [front + apart]])
    s = MODEL.lines[0].position(np.array([speed]), tilt).s

    def distance(where, own):
        return ((tilt - own) ** 2).sum(axis=0) + (np.deg2rad(0.05) * (speed - where)) ** 2

    assert 0.0 <= s[0] <= 25.0
    assert distance(s, MODEL.lines[0].schedule(s))[0] <= distance(DENSE, TILTS).min() + 1e-9


@settings(max_examples=60)
@given(speed=st.floats(-5.0, 40.0), front=angles, rho=st.floats(0.3, 1.5))
def test_what_is_held_is_finite_and_flagged(speed, front, rho):
    inputs = dict.fromkeys(tilt_wing.INPUTS, 0.0) | {"u": speed, "dw1": front, "dw2": front, "rho": rho}
    found = MODEL.wrench(inputs, outside="hold")
    assert np.isfinite(found.values).all()
    assert (found.std_error > 0).all()
    assert np.isfinite(MODEL.gradient(inputs, outside="hold")).all()
    nearest = np.abs(TILTS[0] - front).min()
    assert found.outside[0] or nearest == pytest.approx(0.0, abs=np.deg2rad(5.0))
