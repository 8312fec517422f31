"""Margins against closed forms, and against a walk along the Nyquist curve with a stability test."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.dynamics.linear_loop import Actuation, LinearLoop, stability_margins


def test_an_integrator_with_a_delay():
    """k exp(-s T) / s crosses at k, turned by k T more than a right angle; unstable from k T = pi / 2."""
    k, late = 2.0, 0.1
    found = stability_margins(lambda w: k * np.exp(-1j * w * late) / (1j * w), 0.01, 200.0)
    assert found.crossover_hz == pytest.approx(k / (2 * np.pi))
    assert found.phase_deg == pytest.approx(90 - np.degrees(k * late))
    assert found.gain_up_db == pytest.approx(20 * np.log10(np.pi / 2 / (k * late)))
    assert found.gain_down_db == np.inf
    assert found.delay_s == pytest.approx(np.pi / 2 / k - late)


@pytest.mark.parametrize("damping", [0.2, 0.5, 0.9])
def test_the_second_order_loop_of_the_text_books(damping):
    """w^2 / (s (s + 2 z w)): phase margin atan(2 z / sqrt(sqrt(1 + 4 z^4) - 2 z^2))."""
    w = 3.0
    found = stability_margins(lambda x: w**2 / (1j * x * (1j * x + 2 * damping * w)), 0.01, 200.0)
    root = np.sqrt(np.sqrt(1 + 4 * damping**4) - 2 * damping**2)
    assert found.phase_deg == pytest.approx(np.degrees(np.arctan(2 * damping / root)))
    assert 2 * np.pi * found.crossover_hz == pytest.approx(w * root)
    assert found.delay_s == pytest.approx(np.arctan(2 * damping / root) / (w * root))
    assert found.gain_up_db == np.inf


def test_three_equal_lags_bear_a_gain_of_eight():
    found = stability_margins(lambda w: 2.0 / (1 + 1j * w) ** 3, 0.01, 200.0)
    assert found.gain_up_db == pytest.approx(20 * np.log10(8 / 2))


def test_an_unstable_plant_has_a_least_gain_too():
    """k (s + 1) / (s (s - 1)): stable from k = 1 on, at any higher gain."""
    found = stability_margins(lambda w: 4.0 * (1j * w + 1) / (1j * w * (1j * w - 1)), 0.001, 500.0)
    assert found.gain_down_db == pytest.approx(20 * np.log10(4))
    assert found.gain_up_db == np.inf
    static = stability_margins(
        lambda w: 2.0 / (0.5j * w - 1), 0.01, 500.0
    )  # k / (s T - 1): stable from k = 1 on
    assert static.gain_down_db == pytest.approx(20 * np.log10(2))


def test_an_eigenvalue_that_is_zero_but_for_rounding_is_no_static_gain():
    """Two of them, with a residue of rounding: the loop is 0.016 at any frequency that matters."""
    found = stability_margins(lambda w: 0.016 + 6.5e-18 / (1j * w) ** 2, 0.01, 200.0)
    assert found.gain_up_db == np.inf


def system(seed, effectors=3):
    """Return a random stable closed loop of an unstable plant with actuators of its own kind each."""
    rng = np.random.default_rng(seed)
    from scipy.linalg import solve_continuous_are

    A = 3 * rng.normal(size=(4, 4)) + 2 * np.eye(4)
    B = rng.normal(size=(4, effectors))
    P = solve_continuous_are(A, B, np.eye(4), np.eye(effectors))
    fast = Actuation(
        gain=rng.uniform(0.8, 1.2, effectors),
        delay=rng.uniform(0.0, 0.02, effectors),
        frequency=np.array([50.0, np.inf, 70.0]),
        damping=np.array([0.7, 1.0, 0.9]),
        share=np.array([1.0, 1.0, 0.7]),
        lag=np.array([0.0, 0.03, 0.01]),
        lag_2=np.array([0.0, 0.0, 0.02]),
    )
    names = tuple(f"de{i}" for i in range(effectors))
    return LinearLoop(
        states=("u", "w", "q", "theta"),
        effectors=names,
        axes=("X", "Z", "M"),
        A=A,
        B=B,
        gain=B.T @ P,
        allocation=np.eye(effectors),
        actuation=fast,
    )


def changed(loop, i, *, gain=1.0, late=0.0):
    """Return the loop with one effector's actuator louder or later."""
    act = loop.actuation
    louder, delay = act.gain.copy(), act.delay.copy()
    louder[i] *= gain
    delay[i] += late
    new = Actuation(louder, delay, act.frequency, act.damping, act.share, act.lag, act.lag_2)
    return LinearLoop(loop.states, loop.effectors, loop.axes, loop.A, loop.B, loop.gain, loop.allocation, new)


def bisected(stable, low, high):
    """Return where a stable loop becomes unstable, between a stable and an unstable setting."""
    for _ in range(25):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return 0.5 * (low + high)


def test_margins_are_where_eigenvalues_cross_the_axis():
    """Gains and delays of one actuator changed until the whole closed loop is unstable, by bisection."""
    checked = {"up": 0, "down": 0, "late": 0}
    for seed in range(6):
        loop = system(seed)
        found = loop.margins()
        for i, name in enumerate(loop.effectors if loop.stable else ()):
            m = found[name]
            if m.gain_up_db < 40:
                most = 10 ** (m.gain_up_db / 20)
                at = bisected(lambda g, i=i: changed(loop, i, gain=g).stable, 1.0, 1.5 * most)  # noqa: B023
                assert at == pytest.approx(most, rel=2e-3)
                checked["up"] += 1
            if np.isfinite(m.gain_down_db):
                least = 10 ** (-m.gain_down_db / 20)
                at = 1 / bisected(lambda g, i=i: changed(loop, i, gain=1 / g).stable, 1.0, 1.5 / least)  # noqa: B023
                assert at == pytest.approx(least, rel=2e-3)
                checked["down"] += 1
            if m.delay_s < 0.15:
                at = bisected(lambda t, i=i: changed(loop, i, late=t).stable, 0.0, 1.5 * m.delay_s)  # noqa: B023
                assert at == pytest.approx(m.delay_s, rel=2e-2)  # eigenvalues have the delay by Pade only
                checked["late"] += 1
    assert min(checked.values()) >= 3


def test_a_broken_loop_is_what_comes_back_when_the_others_are_closed():
    """Solved as the linear equations of the cut loop: one unit in at the cut, what returns is -l."""
    loop = system(3)
    w = np.array([0.3, 2.0, 11.0])
    for place, name in enumerate(loop.effectors):
        for k, omega in enumerate(w):
            plant = np.linalg.solve(1j * omega * np.eye(4) - loop.A, loop.B)
            H = np.diag(loop.actuation.response(np.array([omega]))[:, 0])
            back = -loop.gain @ plant @ H  # from what enters actuators to what the law commands
            others = [j for j in range(3) if j != place]
            closed = np.linalg.solve(np.eye(2) - back[np.ix_(others, others)], back[others, place])
            returned = back[place, place] + back[place, others] @ closed
            assert loop.loop_gain(name, w)[k] == pytest.approx(-returned)


def test_eigenvalues_are_the_zeros_of_the_determinant():
    loop = system(1)
    for value in loop.eigenvalues[np.argsort(np.abs(loop.eigenvalues))][:4]:
        plant = np.linalg.solve(value * np.eye(4) - loop.A, loop.B)
        # the response at a complex frequency: omega = value / j
        act = loop.actuation
        ratio = value / act.frequency
        servo = 1 + act.share * (1 / (ratio**2 + 2 * act.damping * ratio + 1) - 1)
        H = act.gain * np.exp(-value * act.delay) * servo / (1 + act.lag * value) / (1 + act.lag_2 * value)
        size = np.linalg.svd(np.eye(3) + loop.gain @ plant * H, compute_uv=False)
        assert size[-1] < 1e-5 * size[0]


def test_an_unknown_place_is_refused():
    with pytest.raises(UsageError, match="de9"):
        system(0).loop_gain("de9", np.array([1.0]))


def test_disk_margins_of_closed_forms():
    """An integrator keeps the largest disk; three lags the least of 2 |1 + L| / |1 - L|, by brute force."""
    assert stability_margins(lambda w: 2.0 / (1j * w), 0.01, 200.0).disk == pytest.approx(2.0, abs=1e-6)

    # Seiler, Packard & Gahinet (2020) use this loop: gain margin 3.6, phase margin 29 deg, disk margin 0.46
    def loop(w):
        s = 1j * np.asarray(w)
        return 25 / (s**3 + 10 * s**2 + 10 * s + 10)

    w = np.linspace(0.5, 5, 400_001)
    found = stability_margins(loop, 0.01, 200.0)
    assert found.disk == pytest.approx((2 * np.abs(1 + loop(w)) / np.abs(1 - loop(w))).min(), rel=1e-6)
    assert found.disk == pytest.approx(0.46, abs=0.005)
    assert found.gain_up_db == pytest.approx(20 * np.log10(3.6), abs=1e-6)
    assert found.phase_deg == pytest.approx(29.1, abs=0.05)
    # a guarantee for gain and for phase alone
    d = found.disk
    assert (2 + d) / (2 - d) < 10 ** (found.gain_up_db / 20)
    assert 2 * np.degrees(np.arctan(d / 2)) < found.phase_deg


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_the_disk_of_all_axes_at_once_is_a_guarantee_that_is_nearly_reached(seed):
    """No perturbation inside the disk reaches the limit; one that is little larger does."""
    loop = system(seed)
    d = loop.disk_margin()
    assert d <= min(loop.margins()[n].disk for n in loop.axes) * (1 + 1e-6)
    omega = np.geomspace(0.01, 300, 1500)
    L = loop._law(omega) @ loop.allocation
    S = np.linalg.inv(np.eye(3) + L) - np.eye(3) / 2
    worst = int(np.linalg.norm(S, 2, axis=(1, 2)).argmax())
    rng = np.random.default_rng(seed)
    # the power method for mu: spectral radius over unitary diagonal matrices, a lower bound that is often it
    radius = 0.0
    for place in range(max(worst - 200, 0), min(worst + 200, omega.size), 4):
        turns = np.exp(2j * np.pi * rng.random((300, 3)))
        radius = max(radius, np.abs(np.linalg.eigvals(S[place] * turns[:, None, :])).max())
    assert 1 / radius >= d * (1 - 1e-9)
    assert 1 / radius < 1.25 * d


def test_effectors_that_answer_alike_share_an_answer():
    """The same loop with actuators that differ by a trifle, so that none are shared, has the same modes."""
    rng = np.random.default_rng(5)
    from scipy.linalg import solve_continuous_are

    A, B = rng.normal(size=(4, 4)), rng.normal(size=(4, 6))
    mixing = rng.normal(size=(6, 2))
    drive = B @ mixing
    P = solve_continuous_are(A, drive, np.eye(4), np.eye(2))

    def loop(spread):
        fast = Actuation(
            gain=np.linspace(0.9, 1.1, 6),
            delay=np.full(6, 0.02),
            frequency=50.0 + spread * np.arange(6),
            damping=np.full(6, 0.8),
            share=np.ones(6),
            lag=np.array([0.0, 0.0, 0.0, 0.05, 0.05, 0.05]),
            lag_2=np.zeros(6),
        )
        names = tuple(f"de{i}" for i in range(6))
        return LinearLoop(("u", "w", "q", "theta"), names, ("X", "M"), A, B, drive.T @ P, mixing, fast)

    shared, apart = loop(0.0), loop(1e-9)
    assert len(shared.eigenvalues) < len(apart.eigenvalues)
    for value in shared.eigenvalues:
        assert np.abs(apart.eigenvalues - value).min() < 1e-4
    assert shared.eigenvalues.real.max() == pytest.approx(apart.eigenvalues.real.max(), abs=1e-6)
