"""The free-running response by transforms, against an integration in time and a closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from freqid.core.errors import UsageError
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.dynamics.control_law import ControlLaw
from freqid.dynamics.controlled import ControlledAircraft, UnevenLags
from freqid.dynamics.linear_loop import Actuation
from freqid.dynamics.small_motion import equations_of_motion

GRAVITY = 9.80665
MASS, INERTIA = 30.0, (2.5, 3.0, 5.0)
NAMES = ("de", "da", "n1")
WRENCH = np.zeros((6, 11))
WRENCH[0, [0, 2, 10]] = -6.0, 4.0, 0.9
WRENCH[1, [1, 3, 5]] = -14.0, 0.6, 2.5
WRENCH[2, [0, 2, 4, 8]] = -28.0, -95.0, -12.0, -60.0
WRENCH[3, [1, 3, 5, 9]] = -5.0, -16.0, 3.0, 45.0
WRENCH[4, [0, 2, 4, 8]] = 0.4, -9.0, -18.0, -42.0
WRENCH[5, [1, 3, 5, 9]] = 8.0, -0.8, -9.0, -1.5
LAG, DELAY = np.array([0.05, 0.05, 0.1]), np.array([0.04, 0.04, 0.0])
DT = 0.02


def gains():
    table = np.zeros((3, 13))
    table[0, [4, 7]] = 0.05, 0.35
    table[1, [3, 6, 8, 12]] = -0.05, -0.3, -0.1, -0.02
    table[2, [0, 9]] = -3.0, -1.0
    return table


def aircraft(up=None, down=None, delay=DELAY, law=None, spin=None):
    vehicle = Vehicle(
        name="test",
        mass_properties=MassProperties(
            mass_kg=MASS, inertia=Inertia(xx=INERTIA[0], yy=INERTIA[1], zz=INERTIA[2])
        ),
        effectors=tuple(Effector(name=n, kind="surface", limits=(-1.0, 1.0)) for n in NAMES),
    )
    lag = LAG if up is None or down is None else 2 / (1 / up + 1 / down)
    one, zero = np.ones(3), np.zeros(3)
    actuation = Actuation(one, delay, np.full(3, np.inf), one, one, lag, zero)
    control = law_of(gains() if law is None else law, actuation)
    spin = np.zeros((3, 3)) if spin is None else spin
    lags = None if up is None or down is None else UnevenLags(up, down)
    velocity = np.array([20.0, 0.0, 1.0])
    return ControlledAircraft(vehicle, WRENCH, velocity, 0.05, spin, np.zeros(3), control, lags)


def law_of(table, actuation):
    """Gains from u v w p q r phi theta psi, integrals of u and v, altitude, integral of psi, as a law."""
    signals = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "alt")
    B = np.zeros((3, 10))
    B[0, 0] = B[1, 1] = B[2, 8] = 1.0
    D = np.hstack([table[:, :9], table[:, [11]]])
    C = table[:, [9, 10, 12]]
    used = C.any(axis=0)
    A = np.zeros((used.sum(), used.sum()))
    return ControlLaw(signals, NAMES, NAMES, A, B[used], C[:, used], D, np.eye(3), actuation, "test")


def multisine(seconds=16.0):
    time = np.arange(0.0, seconds + DT / 2, DT)
    tones = [np.array([0.2 + k / 9, 0.55 + k / 7, 1.1 + k / 5]) for k in range(3)]
    rows = [np.sin(2 * np.pi * np.outer(f, time)).sum(0) for f in tones]
    window = np.clip(np.minimum(time, time[-1] - time) / 2.0, 0.0, 1.0)
    return time, np.array(rows) * np.sin(np.pi / 2 * window) ** 2 * np.array([[0.03], [0.03], [10.0]])


def integrate(time, injected, up, down, delay, law, spin):
    """Integrate the rigid body, its law and its actuators in small steps, equations written out."""
    step, u0, w0, theta = 0.002, 20.0, 1.0, 0.05
    fine = np.arange(0.0, time[-1] + step / 2, step)
    signals = np.array([np.interp(fine, time, row) for row in injected])
    mass_matrix = np.diag([MASS] * 3 + list(INERTIA) + [1.0, 1.0])
    x, d, memory = np.zeros(8), np.zeros(3), np.zeros(5)  # psi, int u, int v, altitude, int psi
    lines = [np.zeros((fine.size, 3))]
    past = lines[0]
    found = np.zeros((8, fine.size))
    positions = np.zeros((3, fine.size))
    lag = np.round(delay / step).astype(int)

    def rates(x, d, memory, asked):
        du = np.where(asked > d, (asked - d) / up, (asked - d) / down)
        u, v, w, p, q, r, phi, th = x
        loads = WRENCH @ np.concatenate([x, d])
        loads[:3] += MASS * np.array([r * 0 - q * w0, p * w0 - r * u0, q * u0])
        loads[:3] += (
            MASS * GRAVITY * np.array([-np.cos(theta) * th, np.cos(theta) * phi, -np.sin(theta) * th])
        )
        loads[3:] -= spin @ du
        dx = np.linalg.solve(mass_matrix, np.append(loads, [p + r * np.tan(theta), q]))
        climb = u * np.sin(theta) - w * np.cos(theta) + (u0 * np.cos(theta) + w0 * np.sin(theta)) * th
        return dx, du, np.array([r / np.cos(theta), u, v, climb, memory[0]])

    for k in range(fine.size):
        found[:, k], positions[:, k] = x, d
        past[k] = law @ np.concatenate([x, memory]) + signals[:, k]
        asked = np.array([past[max(k - lag[i], 0), i] if k >= lag[i] else 0.0 for i in range(3)])
        a = rates(x, d, memory, asked)
        b = rates(*(s + step / 2 * r for s, r in zip((x, d, memory), a, strict=True)), asked)
        x, d, memory = (s + step * r for s, r in zip((x, d, memory), b, strict=True))
    every = slice(None, None, round(DT / step))
    return found[:, every], positions[:, every]


@pytest.mark.parametrize("case", ["even", "uneven", "reaction"])
def test_a_free_run_is_what_integration_makes_of_it(case):
    time, injected = multisine()
    up, down = (LAG, LAG) if case != "uneven" else (LAG, np.array([0.05, 0.05, 0.16]))
    spin = np.zeros((3, 3))
    if case == "reaction":
        spin[0, 2] = 2e-3
    subject = aircraft(up, down, spin=spin)
    states, positions = subject.history(injected, DT)
    x, d = integrate(time, injected, up, down, DELAY, gains(), spin)
    for found, right in ((states, x), (positions, d)):
        error = np.sqrt(np.mean((found - right) ** 2, axis=1))
        assert (error <= 0.012 * np.sqrt(np.mean(right**2, axis=1)) + 1e-9).all()
    if case == "uneven":  # what a linear motor would do is farther off than that
        linear = aircraft().history(injected, DT)[1][2]
        assert np.std(linear - d[2]) > 0.05 * np.std(d[2])


def test_the_steady_response_to_a_sine_is_the_transfer_function():
    subject = aircraft()
    s = np.array([2j * np.pi * 0.7])
    x, d = subject.motion(s, np.array([[1.0], [0.0], [0.0]], dtype=complex))
    # the equations of motion hold line by line, with what the law and the servo make of x
    law = gains()
    asked = law[:, :8] @ x[:, 0] + law[:, 8] * x[5, 0] / np.cos(0.05) / s[0] + law[:, 9] * x[0, 0] / s[0]
    asked += law[:, 12] * x[5, 0] / np.cos(0.05) / s[0] ** 2 + np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(d[:, 0], asked * np.exp(-s * DELAY) / (LAG * s + 1), rtol=1e-9)
    loads = WRENCH[4] @ np.concatenate([x, d])[:, 0]
    np.testing.assert_allclose(INERTIA[1] * s[0] * x[4, 0], loads, rtol=1e-9)


def test_gusts_move_the_air_past_a_heavy_aircraft_that_nothing_pushes():
    subject = aircraft(law=np.zeros((3, 13))).with_wrench(np.zeros((6, 11)))
    s = np.array([2j * np.pi * 0.5])
    gust = np.zeros((6, 1), dtype=complex)
    gust[2] = 1.0
    x, _ = subject.motion(s, np.zeros((3, 1), dtype=complex), gust=gust)
    assert x[2, 0] == pytest.approx(-1.0)  # it stays where it is, and the air moves


def test_the_loop_has_the_eigenvalues_of_its_transfer_functions():
    subject = aircraft(delay=np.zeros(3))
    still = np.zeros((3, 3)), np.zeros(3)
    E, A = equations_of_motion(WRENCH, subject.vehicle, subject.velocity, 0.05, *still)
    for value in subject.loop.eigenvalues:
        s = np.array([value])
        matrix = (s[0] * E - A)[:, :8] + (s[0] * E - A)[:, 8:] @ subject.feedback(s)[0]
        size = np.linalg.svd(matrix, compute_uv=False)
        assert size[-1] < 1e-6 * size[0]


def test_a_motion_that_grows_is_had_too():
    subject = aircraft(law=np.zeros((3, 13)), delay=np.zeros(3))
    growing = WRENCH.copy()
    growing[4, 2] = 9.0  # the nose follows the wind away
    subject = subject.with_wrench(growing)
    values = subject.loop.eigenvalues
    assert values.real.max() > 0.1
    time, injected = multisine(8.0)
    states, _ = subject.history(injected, DT)
    still = np.zeros((3, 3)), np.zeros(3)
    E, A = equations_of_motion(growing, subject.vehicle, subject.velocity, 0.05, *still)

    def rate(t, y):
        e = np.array([np.interp(t, time, row) for row in injected])
        x, d = y[:8], y[8:]
        dx = np.linalg.solve(E[:, :8], A @ np.concatenate([x, d]))
        return np.concatenate([dx, (e - d) / LAG])

    right = solve_ivp(rate, (0, time[-1]), np.zeros(11), t_eval=time, rtol=1e-7, atol=1e-10, max_step=0.02).y
    # of the motion across, which does not grow, nothing is left beside the weight of what does
    for i, name in enumerate(["u", "v", "w", "p", "q", "r", "phi", "theta"]):
        if name in ("u", "w", "q", "theta"):
            assert np.abs(states[i] - right[i]).max() < 0.01 * np.abs(right[i]).max()


def test_a_law_with_states_of_its_own_is_what_its_transfer_function_says():
    """Pitch rate behind a washout, altitude and flow angle, at a trim that moves along and down."""
    velocity, theta = np.array([20.0, 0.0, 1.0]), 0.05
    law = ControlLaw(
        signals=("q", "alt", "alpha"),
        axes=("pitch",),
        effectors=("de",),
        A=np.array([[-2.0]]),
        B=np.array([[1.0, 0.0, 0.0]]),
        C=np.array([[-2.0]]),
        D=np.array([[1.0, 0.03, 0.4]]),
        allocation=np.array([[0.5]]),
        actuation=Actuation.ideal(1),
    )
    s = np.array([0.3j, 0.1 + 2.0j])
    found = law.over(("da", "de")).transfer(s, velocity, theta)
    assert not found[:, 0].any()
    climb = np.array([np.sin(theta), -np.cos(theta), 20.0 * np.cos(theta) + np.sin(theta)])
    speed = np.hypot(20.0, 1.0)
    right = np.zeros((2, 8), dtype=complex)
    right[:, 4] = s / (s + 2.0)
    right[:, [0, 2, 7]] += 0.03 * climb / s[:, None]
    right[:, [0, 2]] += 0.4 * np.array([-1.0, 20.0]) / speed**2
    np.testing.assert_allclose(found[:, 1], 0.5 * right, rtol=1e-12, atol=1e-15)
    # a gust moves what is measured against the air by itself: only the rest is of the ground
    right[:, [0, 2]] -= 0.4 * np.array([-1.0, 20.0]) / speed**2
    ground = law.transfer(s, velocity, theta, air_data=False)
    np.testing.assert_allclose(ground[:, 0], 0.5 * right, rtol=1e-12, atol=1e-15)


def test_a_law_over_all_effectors_keeps_their_order_and_refuses_others():
    law = ControlLaw.of_gains(("q", "p"), ("de", "da"), np.array([[0.4, 0.0], [0.0, -0.2]]))
    wide = law.over(("da", "n1", "de"))
    np.testing.assert_array_equal(wide.allocation @ wide.D, [[0.0, -0.2], [0.0, 0.0], [0.4, 0.0]])
    assert wide.actuation.gain.tolist() == [1.0, 1.0, 1.0]
    with pytest.raises(UsageError, match="moves 'de', which the aircraft does not have"):
        law.over(("da", "n1"))
