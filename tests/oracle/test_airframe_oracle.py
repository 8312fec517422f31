"""The airframe against a slow wrench written from the equations, and against theory's limits."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from slow_airframe import SlowAirframe

from freqid.core.scenario import read_scenario
from freqid.simulate.loads import airframe, description
from freqid.simulate.loads.quantities import Flow, Positions, Wake
from freqid.simulate.loads.wing import induction, strip_centres, strip_edges, strips

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
SPAN, CHORD, SLOPE = 1.83, 0.33, 5.9


@pytest.fixture(scope="module")
def la8():
    return description.parameters(read_scenario(SCENARIO)[0])


@pytest.fixture(scope="module")
def wrench():
    return jax.jit(airframe.wrench)


def draw(seed: int) -> dict:
    """A point of the envelope and beyond it, as plain numpy arrays."""
    rng = np.random.default_rng(seed)
    return {
        "velocity": rng.uniform(-30, 30, 3) * rng.choice([0, 0.1, 1], 3),
        "rates": rng.uniform(-2, 2, 3),
        "rho": rng.uniform(0.9, 1.3),
        "surface": rng.uniform(-0.5, 0.5, 10),
        "tilt": rng.uniform(-0.09, 1.83, 2),
        "tilt_rate": rng.uniform(-0.35, 0.35, 2),
        "speed": rng.uniform(0, 950, 8) * rng.choice([0, 1], 8, p=[0.1, 0.9]),
    }


def as_jax(point: dict) -> tuple[Flow, Positions]:
    # numpy first: a bare float would be a weak type and compile anew
    p = {name: jnp.asarray(np.asarray(value)) for name, value in point.items()}
    flow = Flow(p["velocity"], p["rates"], p["rho"], jnp.float64(100.0))
    return flow, Positions(p["surface"], p["tilt"], p["tilt_rate"], p["speed"])


def assert_same(aero, slow) -> None:
    force, moment, torque, shed = slow
    weight = 28.6 * 9.80665
    scale = max(weight, np.abs(force).max())
    np.testing.assert_allclose(aero.wrench.force, force, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(aero.wrench.moment, moment, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(aero.torque, torque, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(aero.shed.downwash, shed[0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(aero.shed.blowing, shed[1], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seed", range(12))
def test_wrench_equals_the_slow_one(la8, wrench, seed):
    point = draw(seed)
    assert_same(wrench(la8, *as_jax(point)), SlowAirframe(SCENARIO).wrench(**point))


def test_wrench_equals_the_slow_one_along_the_corridor(la8, wrench):
    slow = SlowAirframe(SCENARIO)
    for reference in read_scenario(SCENARIO)[0].reference[::5]:
        point = draw(0) | {
            "velocity": np.array([reference.u, 0.0, 0.1]),
            "rates": np.zeros(3),
            "rho": reference.rho,
            "tilt": np.array([reference["dw1"], reference["dw2"]]),
            "speed": np.full(8, 550.0),
        }
        assert_same(wrench(la8, *as_jax(point)), slow.wrench(**point))


def test_wrench_equals_the_slow_one_with_effects_scaled_and_a_late_wake(la8, wrench):
    strength = {"slipstream": 0.3, "wing_wake": 1.4, "rotor_inplane_force": 0.0}
    scaled = la8._replace(
        effects=la8.effects
        | {n: {**la8.effects[n], "strength": jnp.float64(value)} for n, value in strength.items()}
    )
    point, late = draw(3), (np.array([1.0, 0.4]), np.array([0.3, 2.0]))
    slow = SlowAirframe(SCENARIO, strength).wrench(**point, arriving=late)
    assert_same(wrench(scaled, *as_jax(point), Wake(*(jnp.asarray(x) for x in late))), slow)


def series_solution(chord, terms: int = 80) -> np.ndarray:
    """Glauert's series coefficients A_n per rad of incidence, which the strips do not use."""
    theta = (np.arange(terms) + 0.5) * np.pi / terms
    n = np.arange(1, terms + 1)
    mu = chord(SPAN / 2 * np.cos(theta)) * SLOPE / (4 * SPAN)
    matrix = np.sin(np.outer(theta, n)) * (np.sin(theta)[:, None] + np.outer(mu, n))
    return np.linalg.solve(matrix, mu * np.sin(theta))


def lone_wing(la8, chord) -> tuple:
    """The front wing alone, uncambered, with another chord and no profile drag; and its area."""
    y, count = strip_centres(SPAN, 16), la8.wings.chord.shape[1]
    c = np.broadcast_to(chord(y), (1, count))
    section = la8.wings.section._replace(drag=jnp.zeros(()), lift_drag=jnp.zeros(()))
    wings = jax.tree.map(lambda leaf: leaf[:1] if leaf.ndim > 0 else leaf, la8.wings)
    wings = wings._replace(
        section=section,
        chord=jnp.asarray(c),
        induction=jnp.asarray(induction(SPAN, c[0], SLOPE))[None],
        camber=jnp.zeros((1, count)),
    )
    fine = np.linspace(-SPAN / 2, SPAN / 2, 20001)
    return wings, np.trapezoid(chord(fine), fine)


@pytest.mark.parametrize(
    ("chord", "lift_error", "drag_error"),
    [
        (lambda y: CHORD * np.sqrt(1 - (2 * y / SPAN) ** 2), 0.0015, 0.003),
        (lambda y: np.full_like(y, CHORD), 0.0015, 0.003),
        (lambda y: 0.4 - 0.2 * np.abs(2 * y / SPAN), 0.002, 0.005),
    ],
    ids=["elliptic", "rectangular", "tapered"],
)
def test_strips_without_slipstream_have_the_lift_of_the_lifting_line(la8, chord, lift_error, drag_error):
    wings, area = lone_wing(la8, chord)
    alpha, speed, rho = 0.01, 20.0, 1.2  # so small that neither stall nor cosines matter
    velocity = speed * jnp.array([[np.cos(alpha), 0.0, np.sin(alpha)]])
    still = (jnp.zeros((1, 16)), jnp.zeros((1, 16)))
    force = strips(wings, velocity, jnp.zeros((1, 3)), still, jnp.zeros(10), jnp.float64(rho)).force[0]
    lift = float(force[0] * np.sin(alpha) - force[2] * np.cos(alpha))
    drag = -float(force[0] * np.cos(alpha) + force[2] * np.sin(alpha))

    a = series_solution(chord) * alpha
    n = np.arange(1, len(a) + 1)
    qbar = 0.5 * rho * speed**2
    assert lift == pytest.approx(qbar * np.pi * SPAN**2 * a[0], rel=lift_error)
    assert drag == pytest.approx(qbar * np.pi * SPAN**2 * np.sum(n * a**2), rel=drag_error)
    if chord(np.array([SPAN / 2])) == 0:  # elliptic: the closed form too
        aspect = SPAN**2 / area
        assert lift == pytest.approx(qbar * area * alpha * SLOPE / (1 + SLOPE / (np.pi * aspect)), rel=0.0015)


def test_an_elliptic_wing_has_uniform_downwash():
    chord = CHORD * np.sqrt(1 - (2 * strip_centres(SPAN, 16) / SPAN) ** 2)
    downwash = induction(SPAN, chord, SLOPE) @ np.ones(16)
    np.testing.assert_allclose(downwash, downwash[0], rtol=1e-12)
    assert np.all(np.diff(strip_edges(SPAN, 16)) > 0)


def test_fixed_wing_limit(la8, wrench):
    """Without propellers and wakes the coefficients depend on neither speed nor density."""
    dead = la8.propellers._replace(
        thrust=jnp.zeros(4),
        torque=jnp.zeros(4),
        crossflow_thrust=jnp.zeros(()),
        inplane_force=jnp.zeros(()),
        hub_moment=jnp.zeros(()),
    )
    bare = la8._replace(propellers=dead)
    positions = Positions(jnp.full(10, 0.05), jnp.full(2, 0.06), jnp.zeros(2), jnp.full(8, 600.0))

    def coefficients(speed: float, rho: float) -> np.ndarray:
        flow = Flow(
            speed * jnp.array([1.0, 0.03, 0.02]),
            speed * jnp.array([0.02, 0.01, -0.02]),
            jnp.float64(rho),
            jnp.float64(100.0),
        )
        load = wrench(bare, flow, positions).wrench
        return np.concatenate([load.force, load.moment]) / (0.5 * rho * speed**2)

    slow, fast = coefficients(200.0, 1.225), coefficients(400.0, 0.9)
    np.testing.assert_allclose(slow, fast, rtol=1e-4, atol=1e-7)

    # Two wings of known slope, the rear one in the downwash of the front one: lift slope by hand.
    aspect, area = SPAN / CHORD, SPAN * CHORD
    a = series_solution(lambda y: np.full_like(y, CHORD))
    wing = np.pi * aspect * a[0]

    def lift(tilt: tuple[float, float]) -> float:
        flow = Flow(jnp.array([200.0, 0.0, 0.0]), jnp.zeros(3), jnp.float64(1.0), jnp.float64(100.0))
        where = Positions(jnp.zeros(10), jnp.array(tilt), jnp.zeros(2), jnp.zeros(8))
        return -float(wrench(bare, flow, where, Wake(jnp.zeros(2), jnp.zeros(2))).wrench.force[2])

    step = 1e-3
    for tilts in ((step, 0.0), (0.0, step)):
        slope = (lift(tilts) - lift((-tilts[0], -tilts[1]))) / (2 * step) / (0.5 * 200.0**2 * area)
        # The rear wing also washes the tail, whose lift falls a little; the front wing's wake is cut off.
        share = 1.0 if tilts[0] else 1.0 - tail_loss(la8)
        assert slope == pytest.approx(wing * share, rel=0.01)


def tail_loss(la8) -> float:
    """Share of the rear wing's lift that the tail loses in its downwash, by hand."""
    tail, wakes = la8.tail, la8.wakes
    gap = float(wakes.behind[1, 2] / wakes.behind[1, 0])
    centre = np.exp(-((gap * float(wakes.behind[1, 0]) / float(wakes.depth)) ** 2))
    felt = centre / (1 + np.exp(-8 / np.hypot(1.0, gap)))
    per_circulation = float(wakes.downwash) * 4 / (np.pi * SPAN) * felt
    # lift of the wing: rho V b G; of both panels: rho V/2 S a (w cos(dihedral)) cos(dihedral)
    up = float(tail.up[0, 2]) ** 2
    panels = 0.5 * float(tail.area.sum()) * float(tail.section.lift_slope) * up
    return per_circulation * panels / SPAN
