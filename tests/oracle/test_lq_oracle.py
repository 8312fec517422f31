"""The control law's gains by another road: Kleinman's iteration and a sampled regulator's limit."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_are

from freqid.core.scenario import read_scenario
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.lq import design_law
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion

SCENARIO = read_scenario(Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml")[0]
WEIGHT, SPAN = 28.6 * 9.80665, 1.83
NAMES = ("u00", "u36", "u85-1500m")


@pytest.fixture(scope="module", params=NAMES)
def problem(request):
    """The gain of one condition, and the regulator's problem put together again from the linearisation."""
    parameters = jax.tree.map(jnp.asarray, motion.parameters(SCENARIO))
    at = trim(SCENARIO, parameters, SCENARIO.reference_of(request.param))
    linear = linearize(SCENARIO, parameters, at)
    setting = jax.tree.map(lambda x: np.asarray(x)[0], design_law(SCENARIO, parameters, [at]).settings)
    i = {name: k for k, name in enumerate(STATES)}
    kind = {e.name: e.kind for e in SCENARIO.effector}
    surface = [k for k, name in enumerate(linear.effectors) if kind[name] == "surface"]
    rotor = [k for k, name in enumerate(linear.effectors) if kind[name] == "rotor"]
    effect = linear.B[:, surface] @ setting.surface + linear.B[:, rotor] @ setting.speed

    # states, then integrals of u and v, altitude, integral of psi
    A, B = np.zeros((13, 13)), np.zeros((13, 5))
    A[:9, :9], B[:9] = linear.A, effect
    A[9, i["u"]] = A[10, i["v"]] = A[12, i["psi"]] = 1.0

    def climb(velocity, theta):  # upward speed of a wings-level vehicle
        return velocity[0] * np.sin(theta) - velocity[2] * np.cos(theta)

    step = 1e-5
    for k, name in enumerate("uvw"):
        moved = np.array(at.body.velocity)
        moved[k] += step
        A[11, i[name]] = (
            climb(moved, at.angles[1]) - climb(np.asarray(at.body.velocity), at.angles[1])
        ) / step
    ahead, behind = (climb(np.asarray(at.body.velocity), at.angles[1] + d) for d in (step, -step))
    A[11, i["theta"]] = (ahead - behind) / (2 * step)

    s = SCENARIO.control["lq"]
    deviation = [s["velocity"]] * 3 + [s["rate"]] * 3 + [s["angle"]] * 3
    settling = s["settling_s"]
    deviation += [settling * s["velocity"], settling * s["velocity"], s["altitude"], settling * s["angle"]]
    effort = np.array([s["force"] * WEIGHT] * 2 + [s["moment"] * WEIGHT * SPAN] * 3)
    return setting.gain, A, B, np.diag(np.array(deviation) ** -2.0), np.diag(effort**-2.0)


def test_kleinmans_iteration_stays_at_the_gain_and_finds_it(problem):
    """D. L. Kleinman, IEEE Trans. Automatic Control 13, 1968: Newton's method by Lyapunov equations."""
    gain, A, B, Q, R = problem
    assert np.linalg.eigvals(A - B @ gain).real.max() < 0  # it stabilises
    found = gain * np.array([1.3, 1.2, 1.4, 1.5, 1.3])[:, None]  # axes scaled by guesses
    assert np.linalg.eigvals(A - B @ found).real.max() < 0
    for _ in range(12):
        closed = A - B @ found
        cost = solve_continuous_lyapunov(closed.T, -(Q + found.T @ R @ found))
        found = np.linalg.solve(R, B.T @ cost)
    assert np.allclose(found, gain, rtol=0, atol=1e-8 * np.abs(gain).max(axis=1, keepdims=True))


def test_the_gain_is_the_limit_of_sampled_regulators(problem):
    gain, A, B, Q, R = problem

    def sampled(dt):
        whole = expm(dt * np.block([[A, B], [np.zeros((5, 18))]]))
        F, G = whole[:13, :13], whole[:13, 13:]
        cost = solve_discrete_are(F, G, dt * Q, dt * R)
        return np.linalg.solve(dt * R + G.T @ cost @ G, G.T @ cost @ F)

    scale = np.abs(gain).max(axis=1, keepdims=True)
    errors = [np.abs((sampled(dt) - gain) / scale).max() for dt in (2e-3, 1e-3)]
    assert errors[1] < 0.02
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)  # of first order in the step
