"""Likelihoods of motion: manoeuvres integrated by scipy with formulas of their own, and laws from them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import freqid as fq
from freqid.blend.semi_local.output_error import JoinedManeuver, OutputErrorManeuver
from freqid.blend.semi_local.problem import EstimatedManeuver
from freqid.core.errors import UsageError
from freqid.core.identification import Identification
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.scenario import Airframe, Scenario
from freqid.core.vehicle import Effector, Inertia, Rotor

MASS, AREA, CHORD, INERTIA, RHO, G = 6.0, 0.5, 0.25, 0.38, 1.2, 9.80665
DIAMETER = 0.23
REGRESSORS = ("alpha", "qhat", "de")
SCENARIO = Scenario(
    vehicle=Airframe(
        name="blown",
        mass_kg=MASS,
        inertia=Inertia(xx=0.48, yy=INERTIA, zz=0.8),
        area_m2=AREA,
        span_m=2.0,
        chord_m=CHORD,
    ),
    effector=(
        Effector(name="de", kind="surface", limits=(-0.5, 0.5)),
        Effector(name="n1", kind="rotor", limits=(0.0, 2000.0)),
    ),
    rotor=(Rotor(name="n1", spin=1, inertia=0.0, diameter_m=DIAMETER),),
    identification=Identification(
        responses=("X", "Z", "M"), regressors=REGRESSORS, form="coefficient", method="time"
    ),
)


def derivatives(j):
    """Return coefficients with constants first, of X, Z and M: exponentials of J in four of them."""
    e = np.exp(-4 * j)
    return {
        "CX": (0.02 + 0.3 * e, 0.3, 0.0, 0.0),
        "CZ": (-0.15 - 0.8 * e, -5.0, -5.0, -0.35),
        "Cm": (0.02, -0.9, -14.0, -1.0 - 2.0 * e),
    }


def flown(j, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0, 8, 0.02)
    of = derivatives(j)

    def elevator(t):
        return (
            -0.05 + 0.06 * np.sin(2.1 * t) * np.sin(5.3 * t + 0.4) + 0.04 * np.exp(-(((t - 1.3) / 0.25) ** 2))
        )

    def applied(v, alpha, q, t):
        x = np.array([np.ones_like(alpha), alpha, q * CHORD / (2 * v), elevator(t)])
        return {name: np.tensordot(c, x, 1) * 0.5 * RHO * v**2 * AREA for name, c in of.items()}

    def rates(t, s):
        u, w, q, theta = s
        v, alpha = np.hypot(u, w), np.arctan2(w, u)
        f = applied(v, alpha, q, t)
        return [
            f["CX"] / MASS - q * w - G * np.sin(theta),
            f["CZ"] / MASS + q * u + G * np.cos(theta),
            f["Cm"] * CHORD / INERTIA,
            q,
        ]

    u, w, q, theta = solve_ivp(rates, (0, 8), (15.0, 1.0, 0.0, 0.08), t_eval=time, rtol=1e-9, atol=1e-9).y
    v, alpha = np.hypot(u, w), np.arctan2(w, u)
    f = applied(v, alpha, q, time)
    none, turning = 0 * v, 2 * np.pi * v.mean() / (j * DIAMETER) if np.isfinite(j) else 0.0
    true = {
        "air/V": (v, "m/s", 0.05), "air/alpha": (alpha, "rad", 0.001), "air/beta": (none, "rad", 0.0),
        "air/rho": (none + RHO, "kg/m3", 0.0), "effector/n1": (none + turning, "rad/s", 0.0),
        "effector/de": (elevator(time), "rad", 0.0), "state/p": (none, "rad/s", 0.0),
        "state/q": (q, "rad/s", 0.002), "state/r": (none, "rad/s", 0.0), "state/phi": (none, "rad", 0.0),
        "state/theta": (theta, "rad", 0.001), "state/ax": (f["CX"] / MASS, "m/s2", 0.03),
        "state/ay": (none, "m/s2", 0.0), "state/az": (f["CZ"] / MASS, "m/s2", 0.03),
    }  # fmt: skip
    channels = {
        n: Channel(n, unit, x + s * rng.standard_normal(x.size), 50.0, "scipy")
        for n, (x, unit, s) in true.items()
    }
    return Maneuver(FlightRecord(time, channels), SCENARIO.aircraft())


@pytest.fixture(scope="module")
def problem():
    return OutputErrorManeuver(flown(0.5, 0), SCENARIO.identification)


def test_the_minimum_is_the_estimate_and_near_the_truth(problem):
    found = problem.expand(problem.estimate)
    error = np.sqrt(np.diag(np.linalg.inv(found.information)))
    assert np.abs(found.minimum - problem.estimate).max() < 0.05 * error.max()
    assert problem.misfit(problem.estimate) == pytest.approx(0.0, abs=0.05)
    truth = np.concatenate([derivatives(0.5)[n] for n in ("CX", "CZ", "Cm")])
    assert problem.names[4] == "CZ.0"
    assert problem.misfit(truth) / truth.size < 3  # one in the mean
    assert (np.abs(problem.estimate - truth) < 4.5 * error).all()


def test_the_information_is_the_curvature_of_the_misfit(problem):
    """A standard error away, all else settled, the misfit has grown by one."""
    information = problem.expand(problem.estimate).information
    for k in (0, 4, 9, 11):
        off = np.zeros(problem.estimate.size)
        off[k] = 2 / np.sqrt(information[k, k])
        grown = (problem.misfit(problem.estimate + off) + problem.misfit(problem.estimate - off)) / 2
        assert grown == pytest.approx(4.0, rel=0.1)


def test_an_expansion_elsewhere_points_back(problem):
    information = problem.expand(problem.estimate).information
    off = problem.estimate + 3 * np.linalg.inv(np.linalg.cholesky(information)).T[:, 5]
    minimum, _ = problem.expand(off)
    away, left = (x - problem.estimate for x in (off, minimum))
    assert left @ information @ left < 0.1 * (away @ information @ away)


def test_parts_of_a_manoeuvre_add_up(problem):
    other = EstimatedManeuver(("Cl.0",), np.array([1.0]), np.array([[4.0]]))
    joined = JoinedManeuver([problem, other])
    theta = np.append(problem.estimate, 2.0)
    assert joined.names == (*problem.names, "Cl.0")
    assert joined.misfit(theta) == pytest.approx(4.0, abs=0.05)
    expansion = joined.expand(theta)
    assert expansion.minimum[-1] == 1.0
    assert expansion.information[-1, -1] == 4.0
    assert not expansion.information[-1, :-1].any()


def test_laws_from_the_motion_of_all_manoeuvres():
    flights = [flown(j, 10 + i) for i, j in enumerate((0.35, 0.5, 0.65, 0.9, np.inf))]
    points = [fq.identify_output_error(f, SCENARIO).point for f in flights]
    common = {"clusters": 1, "flights": flights, "scenario": SCENARIO}
    joint = fq.blend_by_advance_ratio(points, kind="one-shot", **common).clusters[0]
    assert joint["Cm.de"].form == "one exponential"
    for name, k in (("Cm.de", 3), ("Cm.alpha", 1), ("Cm.qhat", 2)):
        for j in (0.4, 0.7, np.inf):
            low, high = joint[name].interval(j, 0.999)
            assert low < derivatives(j)["Cm"][k] < high
    semi = fq.blend_by_advance_ratio(points, kind="semi-local", hold=["Cm.de"], **common).clusters[0]
    np.testing.assert_allclose(
        semi.local.estimate[:, semi.local.place("Cm.de")], semi["Cm.de"].value(semi.local.advance_ratio)
    )
    with pytest.raises(UsageError, match="1 flights come with 5 points"):
        fq.blend_by_advance_ratio(points, kind="one-shot", flights=flights[:1], scenario=SCENARIO)
    with pytest.raises(UsageError, match="without a scenario"):
        fq.blend_by_advance_ratio(points, kind="one-shot", flights=flights)
