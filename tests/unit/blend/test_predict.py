"""A held-out manoeuvre through the global model: what is compared with what, and in which band."""

from dataclasses import replace

import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.predict import replay
from freqid.core.errors import DataError
from freqid.identify.loads.wrench import AppliedWrench

SEA = 1.225
SPEEDS = (9.0, 10.0, 11.0, 12.0)


@pytest.fixture(scope="module")
def model():
    return GlobalModel(
        line_up([tilt_wing.exact_point(tilt_wing.trim(u, SEA), f"{u}") for u in SPEEDS], SPEEDS)
    )


def measured(maneuver):
    values = maneuver.record.matrix(f"response/{r}" for r in tilt_wing.RESPONSES)
    return AppliedWrench(tilt_wing.RESPONSES, ("N",) * 3 + ("N m",) * 3, values, np.zeros_like(values))


def transition():
    """Half a minute from 9 to 12 m/s along the trims, all inputs as they are there."""
    time = np.arange(751) / 25.0
    at = [tilt_wing.trim(u, SEA) for u in np.linspace(9, 12, 31)]
    inputs = {n: np.interp(time, np.linspace(0, 30, 31), [a[n] for a in at]) for n in at[0]}
    held = tilt_wing.fly(at[0], 1, noise=0.0, duration=30.0)
    channels = dict(held.record.channels)
    for name, values in inputs.items():
        key = next(k for k in channels if k.endswith("/" + name))
        channels[key] = replace(channels[key], values=values)
    for name, values in zip(tilt_wing.RESPONSES, tilt_wing.loads(inputs), strict=True):
        channels[f"response/{name}"] = replace(channels[f"response/{name}"], values=values)
    return replace(held, record=replace(held.record, channels=channels))


def test_a_transition_is_predicted_with_its_trim(model):
    flight = transition()
    fits = replay(model, flight, measured=measured(flight))
    assert list(fits) == list(tilt_wing.RESPONSES)
    assert fits["Z"].modelled.mean() == pytest.approx(-tilt_wing.WEIGHT, rel=2e-3)
    for name, bound in (("X", 0.3), ("Z", 0.3), ("M", 0.1)):  # of 280 N
        assert fits[name].rms < bound
    assert fits["X"].axis[0] == 0.0


def test_a_manoeuvre_at_a_new_condition_is_predicted(model):
    flight = tilt_wing.fly(tilt_wing.trim(10.5, SEA), 7)
    fits = replay(model, flight, measured=measured(flight))
    for i, fit in enumerate(fits.values()):
        assert fit.rms < 1.15 * tilt_wing.NOISE[i]


def test_both_histories_keep_to_the_band_of_the_points(model):
    flight = tilt_wing.fly(tilt_wing.trim(10.5, SEA), 7)
    banded = GlobalModel(replace(model.corridor, highest_hz=0.5))
    for fit in replay(banded, flight, measured=measured(flight)).values():
        for values in (fit.measured, fit.modelled):
            power = np.abs(np.fft.rfft(values * np.hanning(values.size))) ** 2
            above = np.fft.rfftfreq(values.size, 0.04) > 0.7
            assert power[above].sum() < 1e-3 * power[1:].sum()


def test_the_wrench_is_reconstructed_where_it_is_not_given(model):
    with pytest.raises(DataError, match="channel 'state/ax' is missing"):
        replay(model, tilt_wing.fly(tilt_wing.trim(10.5, SEA), 7))


def test_off_the_corridor_is_refused_or_held(model):
    flight = tilt_wing.fly(tilt_wing.trim(3.0, SEA), 7)
    with pytest.raises(DataError, match="off the corridor"):
        replay(model, flight, measured=measured(flight))
    assert replay(model, flight, measured=measured(flight), outside="hold")["Z"].rms > 0
