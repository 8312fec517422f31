"""Point models under a law, and what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import tilt_wing

from freqid.core.errors import UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.units import STANDARD_GRAVITY
from freqid.gap.closed_loop import Actuation, LinearLoop
from freqid.gap.condition import Condition, trim_authority
from freqid.gap.consequence import compare, peak_excursions
from freqid.gap.model_consequence import model_condition, model_consequence
from freqid.gap.modes import MOTION

AT = tilt_wing.trim(14.0, 1.225)


@pytest.fixture(scope="module")
def model():
    return tilt_wing.exact_point(AT, "u14")


def motion_of(x, held):
    """Return the rates of change of u v w p q r phi theta psi of the tilt-wing, written down again."""
    u, v, w, p, q, r, phi, theta, _ = x
    at = held | dict(zip("uvwpqr", (np.array([a]) for a in (u, v, w, p, q, r)), strict=True))
    X, Y, Z, L, M, N = tilt_wing.loads(at)[:, 0]
    m, inertia, g = 28.6, tilt_wing.VEHICLE.mass_properties.inertia, STANDARD_GRAVITY
    return np.array(
        [
            X / m - g * np.sin(theta) + r * v - q * w,
            Y / m + g * np.cos(theta) * np.sin(phi) + p * w - r * u,
            Z / m + g * np.cos(theta) * np.cos(phi) + q * u - p * v,
            (L + (inertia.yy - inertia.zz) * q * r) / inertia.xx,
            (M + (inertia.zz - inertia.xx) * r * p) / inertia.yy,
            (N + (inertia.xx - inertia.yy) * p * q) / inertia.zz,
            p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)),
            q * np.cos(phi) - r * np.sin(phi),
            (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta),
        ]
    )


def test_a_point_model_moves_as_the_equations_of_motion_do(model):
    """Central differences of the nonlinear equations of motion about the same trim."""
    names = ("dw1", "dw2", "rho", *(n for n in tilt_wing.INPUTS if n not in MOTION))
    held = {n: np.array([float(AT[n])]) for n in names}
    x0 = np.array([AT["u"], 0, AT["w"], 0, 0, 0, 0, 0, 0], dtype=float)
    A = np.empty((9, 9))
    for k in range(9):
        step = np.zeros(9)
        step[k] = 1e-4
        A[:, k] = (motion_of(x0 + step, held) - motion_of(x0 - step, held)) / 2e-4
    found = model_condition(model, tilt_wing.VEHICLE)
    # the model has no lateral forces by longitudinal motion and the other way; nor do the equations
    np.testing.assert_allclose(found.loop.A, A, atol=2e-5)


def law(model):
    """Return pitch held by the ruddervator, roll by the ailerons, with actuators of a servo each."""
    bare = model_condition(model, tilt_wing.VEHICLE).loop
    chosen = ("dr", "da")
    gain = np.zeros((2, 9))
    gain[0, [4, 7]] = -0.4, -1.2
    gain[1, [3, 6]] = 0.05, 0.2
    servo = Actuation(
        np.ones(2), np.full(2, 0.02), np.full(2, 40.0), np.full(2, 0.7), np.ones(2), np.zeros(2), np.zeros(2)
    )
    places = [bare.effectors.index(n) for n in chosen]
    return LinearLoop(MOTION, chosen, ("M", "L"), bare.A, bare.B[:, places], gain, np.eye(2), servo)


def test_a_model_that_is_the_same_costs_nothing_and_its_errors_are_intervals(model):
    found = model_consequence(model, model, tilt_wing.VEHICLE, law(model), draws=30)
    assert all(value == 0 or np.isnan(value) for value in found.change.values())
    low, high = found.change_intervals["modes/short period/frequency"]
    assert low < 0 < high


def test_intervals_are_those_of_the_derivatives_by_linear_propagation(model):
    """Of the bare short period: its derivative by each coefficient, times the covariance."""

    def frequency(of):
        modes = model_condition(of, tilt_wing.VEHICLE).loop.A
        from freqid.gap.modes import named_modes

        return next(m.frequency for m in named_modes(modes) if m.name == "short period")

    variance = 0.0
    for name, response in model.responses.items():
        slope = np.empty(response.estimate.size)
        for k, size in enumerate(response.std_error):
            moved = []
            for sign in (1, -1):
                estimate = response.estimate.copy()
                estimate[k] += sign * size
                changed = {**model.responses, name: replace(response, estimate=estimate)}
                moved.append(frequency(replace(model, responses=changed)))
            slope[k] = (moved[0] - moved[1]) / (2 * size)
        variance += slope @ response.covariance @ slope
    found = model_consequence(model, model, tilt_wing.VEHICLE, draws=200, level=0.683)
    low, high = found.after_intervals["modes/short period/frequency"]
    assert (high - low) / 2 == pytest.approx(np.sqrt(variance), rel=0.15)


def test_less_pitch_damping_and_a_later_servo_are_told_apart_in_what_they_cost(model):
    pitch = model.responses["M"]
    estimate = pitch.estimate.copy()
    estimate[pitch.regressors.index("q")] *= 0.5
    weaker = replace(model, responses={**model.responses, "M": replace(pitch, estimate=estimate)})
    design = law(model)
    damping = model_consequence(model, weaker, tilt_wing.VEHICLE, design, draws=0)
    assert damping.change["modes/short period/damping"] < -0.01
    servo = replace(design.actuation, delay=np.full(2, 0.06))
    late = model_consequence(model, model, tilt_wing.VEHICLE, design, actuation=servo, draws=0)
    assert late.change["modes/short period/damping"] == 0
    assert late.change["margins/dr/phase_deg"] < -3
    assert late.sentence().startswith("as flown it costs")


def test_an_unstable_loop_says_so_in_place_of_margins():
    def held(gain):
        loop = LinearLoop(
            ("q",),
            ("dr",),
            ("M",),
            np.array([[1.0]]),
            np.array([[1.0]]),
            np.array([[gain]]),
            np.eye(1),
            Actuation.ideal(1),
        )
        return Condition(loop)

    found = compare(held(3.0), held(0.5))
    assert found.before.margins["M"].gain_down_db == pytest.approx(20 * np.log10(3))
    assert not found.after.stable
    assert np.isnan(found.after.figures()["margins/M/phase_deg"])
    assert "unstable" in found.sentence()


def test_authority_is_the_way_to_the_nearer_limit():
    limits = {"de1": (-0.5, 0.5), "n1": (0.0, 800.0), "df1": (-0.2, 0.6)}
    used = trim_authority({"de1": -0.1, "n1": 600.0, "df1": 0.6, "dw1": 1.0}, limits)
    assert used == pytest.approx({"de1": 0.2, "n1": 0.5, "df1": 1.0})


def test_excursions_are_from_where_the_flight_began():
    values = np.array([0.1, 0.3, -0.4, 0.0])
    channel = Channel("state/theta", "rad", values, 1.0, "test")
    record = FlightRecord(np.arange(4.0), {"state/theta": channel})
    assert peak_excursions(record, ["state/theta"]) == pytest.approx({"state/theta": 0.5})


def test_models_in_coefficients_and_laws_with_unknown_effectors_are_refused(model):
    with pytest.raises(UsageError, match="coefficient"):
        model_condition(replace(model, form="coefficient"), tilt_wing.VEHICLE)
    with pytest.raises(UsageError, match="de9"):
        model_condition(model, tilt_wing.VEHICLE, replace(law(model), effectors=("dr", "de9")))
