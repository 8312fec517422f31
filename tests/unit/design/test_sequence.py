"""Classic inputs from a scenario: shapes, defaults, and the motion they are expected to lead to."""

import msgspec
import numpy as np
import pytest
from linear_design import AMPLITUDE, GAINS, VEHICLE
from scipy.signal import lsim

from freqid.core.errors import UsageError
from freqid.core.sections.excitation import Classic, Excitation
from freqid.design.classic import design_classic, extent
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.design.multisine.signals import at_least, at_most

TRIM = {"de": 0.0, "da": 0.0, "dr": 0.0, "n1": 420.0}
EXCITATION = Excitation(band_hz=(0.1, 1.6), period_s=20.0, periods=1, amplitude=AMPLITUDE)


def test_steps_last_half_a_period_of_the_middle_of_the_band():
    doublets = design_classic("doublet", EXCITATION, VEHICLE, TRIM)
    row = doublets.inputs.values[0]
    assert np.count_nonzero(row == 0.06) == pytest.approx(1.25 / 0.02, abs=1)  # the middle is 0.4 Hz
    steps = design_classic("3-2-1-1", EXCITATION, VEHICLE, TRIM).inputs.values[0]
    lengths = np.diff(np.flatnonzero(np.diff(steps, prepend=0.0, append=0.0)))
    np.testing.assert_allclose(lengths[:4] / lengths[3], [3, 2, 1, 1], atol=0.05)
    asked = msgspec.structs.replace(EXCITATION, classic=Classic(step_s=0.5, rest_s=1.0))
    given = design_classic("doublet", asked, VEHICLE, TRIM)
    assert np.count_nonzero(given.inputs.values[0]) == 50
    assert given.duration_s == pytest.approx(4 * (1.0 + 1.0 + 0.02) + 1.0 - 0.02)


def test_a_sweep_goes_through_the_band_once_for_each_effector():
    found = design_classic("sweep", EXCITATION, VEHICLE, TRIM)
    power = np.abs(np.fft.rfft(found.inputs.values)) ** 2
    f = np.fft.rfftfreq(found.inputs.time.size, 0.02)
    inside = (f >= 0.1 / np.sqrt(2)) & (f <= 1.6)  # the first period alone spreads below the band
    assert (power[:, inside].sum(axis=1) > 0.97 * power.sum(axis=1)).all()


def test_extent_is_of_the_samples():
    found = design_classic("sweep", EXCITATION, VEHICLE, TRIM)
    judged = extent(found)
    assert judged.names == tuple(AMPLITUDE)
    np.testing.assert_allclose(judged.peak, list(AMPLITUDE.values()), rtol=2e-3)
    # It is fastest where it begins to fade, 17 s of 20 s through four octaves.
    assert judged.slew[0] == pytest.approx(0.06 * 2 * np.pi * 0.1 * 16**0.85, rel=0.03)


@pytest.mark.parametrize("waveform", ["doublet", "3-2-1-1", "sweep"])
def test_expected_motion_is_that_of_a_simulation(linear_aircraft, waveform):
    loop = perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS)
    asked = Classic(rise_s=0.2, rest_s=25.0)
    design = design_classic(waveform, msgspec.structs.replace(EXCITATION, classic=asked), VEHICLE, TRIM)
    # Positions follow commands at once, x2 = G x1 + e: the states alone are an ordinary system.
    a = np.linalg.solve(loop.E[:8, :8], loop.A[:8, :8] + loop.A[:8, 8:] @ loop.A[8:, :8])
    b = np.linalg.solve(loop.E[:8, :8], loop.A[:8, 8:])
    inputs = np.zeros((design.inputs.time.size, 4))
    for name, row in zip(design.names, design.inputs.values, strict=True):
        inputs[:, loop.effectors.index(name)] = row
    _, _, states = lsim((a, b, np.eye(8), np.zeros((8, 4))), inputs, design.inputs.time)
    found = excursions(design, loop, ("p", "q", "r", "phi", "theta", "w"))
    expected = np.abs(states[:, [3, 4, 5, 6, 7, 2]]).max(axis=0)
    np.testing.assert_allclose(found.peak, expected, rtol=0.03)


def test_what_the_memory_cannot_hold_is_refused():
    long = msgspec.structs.replace(EXCITATION, classic=Classic(rest_s=1e6))
    with pytest.raises(UsageError, match="expected at most 10000000"):
        design_classic("doublet", long, VEHICLE, TRIM)


@pytest.mark.parametrize("value", [0.123456, 1234.567, 0.5, 2.0, 9.99999, 1e-7, 0.1 + 0.2, 1e-310, 0.0])
def test_bounds_as_written_are_feasible(value):
    assert float(at_most(value)) <= value * (1 + 1e-9)
    assert float(at_least(value)) >= value * (1 - 1e-9)
    assert float(at_least(value)) - float(at_most(value)) <= max(2e-3 * value, 1e-300)
