"""The small-perturbation model against differences of nonlinear equations, and what it refuses."""

import msgspec
import numpy as np
import pytest
from linear_design import AMPLITUDE, GAINS, VEHICLE, design
from scipy.integrate import solve_ivp

from freqid.core.errors import UsageError
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle, Wing
from freqid.design.forecast.closed_loop import STATES
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import derivatives_of, perturbed_aircraft

EFFECTORS = tuple(AMPLITUDE)
FREQUENCIES = np.array([0.05, 0.2, 0.7, 1.8])


@pytest.fixture(scope="module")
def loop(linear_aircraft):
    return perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS)


def differences(function, at, h=1e-5):
    return np.array([(function(at + h * d) - function(at - h * d)) / (2 * h) for d in np.eye(at.size)]).T


def slope_of(aircraft):
    """Nonlinear motion of the example under GAINS as a function of state (nine) and excitation (four)."""

    def slope(x, excitation):
        position = dict(zip(EFFECTORS, excitation, strict=True))
        for name, row in GAINS.items():
            position[name] += sum(k * x[aircraft.STATES.index(n)] for n, k in row.items())
        return aircraft.motion(x, aircraft.wrench(x, {n: aircraft.TRIM[n] + e for n, e in position.items()}))

    return slope


def test_states_respond_as_the_linearised_nonlinear_motion(linear_aircraft, loop):
    slope, trim = slope_of(linear_aircraft), np.array([20.0, *np.zeros(8)])
    a = differences(lambda x: slope(x, np.zeros(4)), trim)[:8, :8]
    b = differences(lambda e: slope(trim, e), np.zeros(4))[:8]
    expected = np.array([np.linalg.solve(2j * np.pi * f * np.eye(8) - a, b) for f in FREQUENCIES])
    found = loop.response(STATES, EFFECTORS, FREQUENCIES)
    assert found.shape == (8, 4, 4)
    # rtol by the largest entry of a channel: the symmetric half does not respond to the other's effectors.
    error = np.abs(np.moveaxis(found, 2, 0) - expected).max(axis=(0, 2))
    assert (error < 1e-6 * np.abs(expected).max(axis=(0, 2))).all()
    np.testing.assert_allclose(np.poly(loop.modes()[0]), np.poly(a), rtol=1e-6)


def test_pitched_reference_with_rotors_and_lags_follows_the_nonlinear_equations():
    """A vehicle with every term: products of inertia, pitch angle, tilted rotors' momentum, lags."""
    inertia = Inertia(xx=2.4, yy=3.1, zz=4.9, xz=0.15, xy=0.05, yz=-0.1)
    vehicle = Vehicle(
        name="full",
        mass_properties=MassProperties(mass_kg=20.0, inertia=inertia),
        effectors=(
            Effector(name="n1", kind="rotor", limits=(0.0, 900.0)),
            Effector(name="dw1", kind="tilt", limits=(0.0, 1.6)),
        ),
        rotors=(Rotor(name="n1", spin=-1, inertia=0.01, wing="front"),),
        wings=(Wing(name="front", tilt="dw1", pivot_m=(0.0, 0.0, 0.0)),),
    )
    rng = np.random.default_rng(0)
    names = ("u", "v", "w", "p", "q", "r", "n1", "dw1")
    table = {c: dict(zip(names, rng.normal(0, 2, 8), strict=True)) for c in "XYZLMN"}
    for component, state in zip("XYZLMN", "uvwpqr", strict=True):
        table[component][state] = -90.0
    table["M"]["n1"], table["L"]["dw1"] = -40.0, 40.0  # what the feedback below holds the attitude with
    gains = {"n1": {"theta": 0.5, "r": 0.2}, "dw1": {"phi": -0.4}}
    lag, trim, theta, u = {"n1": 0.1}, {"n1": 400.0, "dw1": 0.6}, 0.3, 15.0
    loop = perturbed_aircraft(table, vehicle, u=u, theta=theta, gains=gains, lag_s=lag, trim=trim)

    derivatives = np.array([[table[c][n] for n in names] for c in "XYZLMN"])
    matrix = np.array([[2.4, -0.05, -0.15], [-0.05, 3.1, 0.1], [-0.15, 0.1, 4.9]])
    reference = np.array([u, 0.0, u * np.tan(theta)])
    shaft = -0.01 * np.array([np.cos(0.6), 0.0, -np.sin(0.6)])
    weight = 20.0 * 9.80665

    def slope(x, excitation):
        """x: eight states as perturbations, and the rotor's speed as one; dw1 has no lag."""
        velocity, w, phi, pitch = reference + x[:3], x[3:6], x[6], theta + x[7]
        tilt = excitation[1] - 0.4 * phi
        applied = derivatives @ np.concatenate([x[:6], [x[8], tilt]])
        down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(phi), np.cos(pitch) * np.cos(phi)])
        trimmed = np.array([-np.sin(theta), 0.0, np.cos(theta)])
        speed_rate = (excitation[0] + 0.5 * x[7] + 0.2 * x[5] - x[8]) / 0.1
        spin = shaft * (400.0 + x[8])
        moment = applied[3:] - np.cross(w, matrix @ w + spin) - shaft * speed_rate
        return np.concatenate(
            [
                (applied[:3] + weight * (down - trimmed)) / 20.0 - np.cross(w, velocity),
                np.linalg.solve(matrix, moment),
                [w[0] + (w[1] * np.sin(phi) + w[2] * np.cos(phi)) * np.tan(pitch)],
                [w[1] * np.cos(phi) - w[2] * np.sin(phi)],
                [speed_rate],
            ]
        )

    a = differences(lambda x: slope(x, np.zeros(2)), np.zeros(9))
    b = differences(lambda e: slope(np.zeros(9), e), np.zeros(2))
    expected = np.array([np.linalg.solve(2j * np.pi * f * np.eye(9) - a, b) for f in FREQUENCIES])
    found = loop.response((*STATES, "n1"), ("n1", "dw1"), FREQUENCIES)
    np.testing.assert_allclose(np.moveaxis(found, 2, 0), expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(np.poly(loop.modes()[0]), np.poly(a), rtol=1e-6)


def test_specific_forces_and_air_data_follow_from_states(linear_aircraft, loop):
    channels = ("ax", "V", "alpha", "beta", "phat", "qhat", "rhat", "Z")
    got = dict(zip(channels, loop.response(channels, ("de",), FREQUENCIES)[:, 0], strict=True))
    x = dict(zip((*STATES, "de"), loop.response((*STATES, "de"), ("de",), FREQUENCIES)[:, 0], strict=True))
    row = linear_aircraft.DERIVATIVES["X"]
    force = sum(row[n] * x[n] for n in ("u", "w", "q", "de"))
    np.testing.assert_allclose(got["ax"], force / linear_aircraft.MASS, rtol=1e-12)
    for name, expected in {
        "V": x["u"],
        "alpha": x["w"] / 20.0,
        "beta": x["v"] / 20.0,
        "phat": x["p"] * 1.83 / 40,
        "qhat": x["q"] * 0.3 / 40,
        "rhat": x["r"] * 1.83 / 40,
    }.items():
        np.testing.assert_allclose(got[name], expected, rtol=1e-12, atol=1e-14)
    assert loop.units(("u", "alpha", "Z", "n1")) == ("m/s", "rad", "N", "rad/s")


def test_excursions_are_those_of_a_long_simulation(linear_aircraft, loop):
    small = design(seed=4)
    time = np.linspace(0.0, small.period_s, 7, endpoint=False)
    flown = excursions(small, loop, STATES)
    slope, trim = slope_of(linear_aircraft), np.array([20.0, *np.zeros(8)])
    a = differences(lambda x: slope(x, np.zeros(4)), trim)[:8, :8]
    b = differences(lambda e: slope(trim, e), np.zeros(4))[:8]

    def moving(t, x):
        excitation = [
            s.amplitude @ np.sin(2 * np.pi * s.index * t / small.period_s + s.phase) for s in small.signals
        ]
        return a @ x + b @ excitation

    start = flown.values[:, 0]  # from any other state there would be a transient
    solved = solve_ivp(moving, (0, time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-9).y
    expected = np.array([np.interp(time, flown.time, row) for row in flown.values])
    assert (np.abs(solved - expected) < 2e-3 * np.abs(flown.values).max(axis=1, keepdims=True)).all()


def test_rates_and_figures_of_excursions(loop):
    flown = excursions(design(), loop, ("de", "theta"))
    rates = excursions(design(), loop, ("de", "theta"), rate=True)
    assert flown.units == ("rad", "rad")
    assert rates.units == ("rad/s", "rad/s")
    step = flown.time[1]
    expected = (np.roll(flown.values, -1, axis=1) - np.roll(flown.values, 1, axis=1)) / (2 * step)
    np.testing.assert_allclose(rates.values, expected, atol=5e-3 * rates.peak.max())
    np.testing.assert_array_equal(flown.peak, np.abs(flown.values).max(axis=1))
    np.testing.assert_allclose(flown.rms, np.sqrt((flown.values**2).mean(axis=1)))


def test_gains_as_an_array_are_gains_by_name(linear_aircraft, loop):
    table = np.zeros((4, 8))
    for name, row in GAINS.items():
        for state, gain in row.items():
            table[EFFECTORS.index(name), STATES.index(state)] = gain
    same = perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=table)
    np.testing.assert_array_equal(same.A, loop.A)
    with pytest.raises(UsageError, match="shape"):
        perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=table[:2])


def test_an_unstable_loop_is_refused_and_says_which_mode(linear_aircraft):
    with pytest.raises(UsageError, match=r"oscillation of period 1\.\d+ s in (v|r) and (v|r) doubles in \d"):
        perturbed_aircraft(linear_aircraft.DERIVATIVES, VEHICLE, u=20.0, gains=GAINS | {"dr": {"r": -1.0}})
    pitching = linear_aircraft.DERIVATIVES | {"M": {"w": 6.0, "q": -18.0}}
    with pytest.raises(UsageError, match=r"a motion in (w|q) and (w|q) doubles"):
        perturbed_aircraft(pitching, VEHICLE, u=20.0, gains={"da": GAINS["da"]})
    with pytest.raises(UsageError, match="does not decay"):
        perturbed_aircraft({}, VEHICLE, u=0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"derivatives": {"K": {}}}, "response 'K' is unknown; known names are: L, M"),
        ({"derivatives": {"Z": {"phi": 1.0}}}, "regressor of 'Z' 'phi' is unknown"),
        ({"gains": {"dee": {"q": 1.0}}}, "effector with gains 'dee' is unknown; did you mean 'de'"),
        ({"gains": {"de": {"psi": 1.0}}}, "state fed back to 'de' 'psi' is unknown"),
        ({"lag_s": {"dx": 0.1}}, "effector with a lag 'dx' is unknown"),
        ({"lag_s": {"de": -0.1}}, "lag of 'de' is -0.1 s"),
        ({"trim": {"n9": 1.0}}, "trimmed effector 'n9' is unknown"),
    ],
)
def test_slips_are_named(linear_aircraft, change, message):
    request = {
        "derivatives": linear_aircraft.DERIVATIVES,
        "vehicle": VEHICLE,
        "u": 20.0,
        "gains": GAINS,
    } | change
    with pytest.raises(UsageError, match=message):
        perturbed_aircraft(**request)


def test_unknown_channels_are_named_and_hover_has_no_flow_angles(loop):
    with pytest.raises(UsageError, match=r"channel 'thta'.*did you mean 'theta'"):
        loop.rows(("thta",))
    with pytest.raises(UsageError, match="excited effector 'dx' is unknown"):
        loop.response(("u",), ("dx",), FREQUENCIES)
    drag = {c: {s: -5.0} for c, s in zip("XYZLMN", "uvwpqr", strict=True)}
    bare = msgspec.structs.replace(VEHICLE, span_m=None)
    keep = {"de": {"theta": -1.0}, "da": {"phi": -1.0}}
    lifted = drag | {"M": {"q": -5.0, "de": 9.0}, "L": {"p": -5.0, "da": 9.0}}
    hover = perturbed_aircraft(lifted, bare, u=0.0, gains=keep)
    with pytest.raises(UsageError, match="'alpha' is undefined in hover"):
        hover.rows(("alpha",))
    cruise = perturbed_aircraft(lifted, bare, u=1.0, gains=keep)
    with pytest.raises(UsageError, match="channel 'phat'"):
        cruise.rows(("phat",))


def test_derivatives_come_from_a_point_model_of_forces_in_body_axes(linear_aircraft):
    from types import SimpleNamespace as Stub

    responses = {
        c: Stub(regressors=tuple(row), estimate=np.array(list(row.values())))
        for c, row in linear_aircraft.DERIVATIVES.items()
    }
    model = Stub(form="force", axes="body", responses=responses)
    assert derivatives_of(model) == linear_aircraft.DERIVATIVES
    with pytest.raises(UsageError, match="form 'coefficient' in stability axes"):
        derivatives_of(Stub(form="coefficient", axes="stability", responses=responses))
