"""Wrench reconstruction against point masses moved in inertial axes, and against stored flight data."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io
from point_masses import TiltWingAircraft, clock, cos, sin
from scipy.integrate import newton_cotes

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.units import to_si
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.spectra.fourier import FourierPlan

# ------------------------------------------------------------------------- exact operators
NODES = np.arange(11)
_WEIGHTS = np.array([(-1.0) ** k * float(np.prod([1 / abs(k - j) for j in NODES if j != k])) for k in NODES])
# Derivative at each of eleven equidistant nodes of the polynomial through all of them.
_STENCIL = np.array([[0 if j == k else _WEIGHTS[j] / _WEIGHTS[k] / (k - j) for j in NODES] for k in NODES])
_STENCIL -= np.diag(_STENCIL.sum(axis=1))


def differentiate(x, dt):
    """Return the derivative, exact for polynomials of degree ten: central, one-sided at the ends."""
    windows = np.lib.stride_tricks.sliding_window_view(x, 11, axis=-1)
    inner = windows @ _STENCIL[5]
    left, right = x[..., :11] @ _STENCIL[:5].T, x[..., -11:] @ _STENCIL[6:].T
    return np.concatenate((left, inner, right), axis=-1) / dt


def transform(x, dt, frequencies):
    """Return the finite Fourier integral by composite Newton-Cotes panels of ten intervals."""
    weights = np.zeros(x.shape[-1])
    panel = newton_cotes(10)[0]
    for start in range(0, weights.size - 1, 10):
        weights[start : start + 11] += dt * panel
    time = dt * np.arange(weights.size)
    return (x * weights) @ np.exp(-2j * np.pi * np.outer(time, frequencies))


def worst(found, truth, inside=slice(None)):
    """Return the largest error of each row, relative to the largest value of the row."""
    return np.abs(found - truth)[:, inside].max(axis=1) / np.abs(truth).max(axis=1)


def test_taylor_arithmetic():
    t = clock(np.array([0.3, 1.1]))
    x = sin(t * t) * cos(t * 3.0) + 2.0
    a, b, s = t.v**2, 3 * t.v, t.v
    np.testing.assert_allclose(x.d, 2 * s * np.cos(a) * np.cos(b) - 3 * np.sin(a) * np.sin(b))
    np.testing.assert_allclose(
        x.dd,
        (2 * np.cos(a) - 4 * a * np.sin(a)) * np.cos(b)
        - 12 * s * np.cos(a) * np.sin(b)
        - 9 * np.sin(a) * np.cos(b),
    )


# ------------------------------------------------------------------------- the analytic aircraft
TIME = np.linspace(0.0, 8.0, 1001)
ONE_SENSOR = ((0.4, -0.2, 0.3),) * 3
THREE_SENSORS = ((0.4, -0.2, 0.3), (-0.7, 0.5, 0.1), (1.1, 0.1, -0.4))
LINES = np.linspace(0.13, 1.7, 40)  # on harmonics of 1/T and off them


@pytest.fixture(scope="module")
def aircraft():
    return TiltWingAircraft(TIME)


@pytest.fixture(scope="module")
def truth(aircraft):
    return aircraft.force_and_moment()


def transformed(wrench, dt):
    """Return the wrench in the frequency domain: its derivative is a multiplication and two end terms."""
    omega, last = 2j * np.pi * LINES, np.exp(-2j * np.pi * LINES * (TIME[-1] - TIME[0]))
    momentum = wrench.momentum
    changing = omega * transform(momentum, dt, LINES) + momentum[:, -1:] * last - momentum[:, :1]
    return transform(wrench.direct, dt, LINES) + changing


def history(maneuver, **options):
    wrench = applied_wrench(maneuver, differentiate=differentiate, **options)
    return wrench.history(maneuver.record.dt, differentiate)


@pytest.mark.parametrize("sensors", [ONE_SENSOR, THREE_SENSORS])
@pytest.mark.parametrize("source", ["transform", "record"])
def test_eight_rotors_on_two_moving_wings_in_time(aircraft, truth, sensors, source):
    found = history(aircraft.maneuver(sensors), angular_acceleration=source)
    assert worst(found, truth).max() < 1e-9


def test_eight_rotors_on_two_moving_wings_in_frequency(aircraft, truth):
    maneuver = aircraft.maneuver()
    wrench = applied_wrench(maneuver, differentiate=differentiate)
    assert (
        worst(transformed(wrench, maneuver.record.dt), transform(truth, maneuver.record.dt, LINES)).max()
        < 1e-9
    )


def test_the_transform_of_the_product_gives_the_same(aircraft, truth):
    maneuver = aircraft.maneuver()
    dt = maneuver.record.dt
    wrench = applied_wrench(maneuver, differentiate=differentiate)
    plan = FourierPlan(TIME.size, dt, LINES)
    found = plan(wrench.direct) + plan.derivative(wrench.momentum)
    assert worst(found, transform(truth, dt, LINES)).max() < 1e-9


def test_the_default_derivative_is_good_enough_for_clean_rates(aircraft, truth):
    maneuver = aircraft.maneuver()
    found = applied_wrench(maneuver).history(maneuver.record.dt)
    assert worst(found, truth).max() < 2e-6


def test_without_rotor_terms_the_moment_is_that_of_locked_rotors(aircraft, truth):
    found = history(aircraft.maneuver(), rotors=False)
    locked = TiltWingAircraft(TIME, spinning=False).force_and_moment()
    assert worst(found, locked).max() < 1e-9
    error = worst(found, truth)
    assert error[:3].max() < 1e-9  # a spinning balanced rotor needs no force
    assert error[3:].min() > 0.05


def test_without_wing_terms_the_moment_is_that_of_wings_held_still(aircraft, truth):
    found = history(aircraft.maneuver(), rotors=False, wings=False)
    held = TiltWingAircraft(TIME, spinning=False, tilting=False).force_and_moment()
    assert worst(found[3:], held[3:]).max() < 1e-9
    error = worst(history(aircraft.maneuver(), wings=False), truth)
    assert error.min() > 0.005
    assert error[3:].min() > 0.05


def test_forms_and_axes(aircraft, truth):
    maneuver, vehicle = aircraft.maneuver(), aircraft.vehicle
    alpha, qbar = maneuver.record["air/alpha"].mean(), maneuver.record["air/qbar"]
    c, s = np.cos(alpha), np.sin(alpha)
    x, y, z, roll, pitch, yaw = truth
    stability = np.array([x * c + z * s, y, z * c - x * s, roll * c + yaw * s, pitch, yaw * c - roll * s])
    lengths = np.array([1, 1, 1, vehicle.span_m, vehicle.chord_m, vehicle.span_m])
    for axes, wanted in (("body", truth), ("stability", stability)):
        assert worst(history(maneuver, axes=axes), wanted).max() < 1e-9
        coefficients = wanted / (qbar * vehicle.area_m2 * lengths[:, None])
        assert worst(history(maneuver, axes=axes, form="coefficient"), coefficients).max() < 1e-9
        # In the frequency domain too, although dynamic pressure changes by a factor of 2.3.
        wrench = applied_wrench(maneuver, form="coefficient", axes=axes, differentiate=differentiate)
        dt = maneuver.record.dt
        assert worst(transformed(wrench, dt), transform(coefficients, dt, LINES)).max() < 1e-9


# ------------------------------------------------------------------------- stored flight data
# The author removed biases of p, r and ay before he computed CX to Cn; the first two follow from
# columns 71 and 73 of the same file, that of ay is the constant that column 62 differs by.
AY_BIAS_G = 0.11341965207723109


def test_twin_otter_coefficients_are_the_stored_ones(shared_data):
    data = scipy.io.loadmat(shared_data / "sidpac" / "totter_f1_017_data.mat")["fdata"]

    def column(number, unit="1", si="1"):
        return data[:, number - 1] * to_si(unit, si, f"column {number}").factor

    feet = to_si("ft", "m", "").factor
    speed, area = column(2, "ft/s", "m/s"), data[0, 76] * feet**2
    span, chord = data[0, 77] * feet, data[0, 78] * feet
    values = {"air/qbar": column(27, "psf", "Pa")}
    for name, number, length in (("p", 71, span), ("q", 72, chord), ("r", 73, span)):
        values[f"state/{name}"] = column(number) * 2 * speed / length
    for i, name in enumerate("pqr"):
        values[f"state/{name}dot"] = column(42 + i, "deg/s2", "rad/s2")
    for i, name in enumerate("xyz"):
        g = data[:, 10 + i] + (AY_BIAS_G if name == "y" else 0.0)
        values[f"state/a{name}"] = g * 32.174 * feet  # the author's g, ft/s2
    # Mass and inertia drift by up to 3e-4 as fuel burns; a vehicle has one of each, the first sample's.
    mass, inertia = column(48, "slug", "kg"), data[:, 48:52] * to_si("slug ft2", "kg m2", "").factor
    xx, yy, zz, xz = inertia[0]
    vehicle = Vehicle(
        name="Twin Otter",
        mass_properties=MassProperties(mass_kg=mass[0], inertia=Inertia(xx=xx, yy=yy, zz=zz, xz=xz)),
        area_m2=area,
        span_m=span,
        chord_m=chord,
    )
    time = 0.02 * np.arange(len(data))
    channels = {n: Channel(n, si_unit(n) or "", x, 50.0, "stored") for n, x in values.items()}
    maneuver = Maneuver.of(FlightRecord(time, channels, vehicle))
    found = applied_wrench(maneuver, form="coefficient", angular_acceleration="record").history(0.02)
    thrust = (column(38, "lbf", "N") + column(39, "lbf", "N")) / (values["air/qbar"] * area)
    stored = data[:, 60:66].T + np.outer([1, 0, 0, 0, 0, 0], thrust)  # his CX is without thrust
    assert worst(found, stored).max() < 3e-4
    assert worst(found[:3] * (mass / mass[0]), stored[:3]).max() < 1e-13
    undrifted = np.all(inertia == inertia[0], axis=1)
    assert undrifted.sum() > 300
    assert worst(found[3:], stored[3:], undrifted).max() < 1e-12
