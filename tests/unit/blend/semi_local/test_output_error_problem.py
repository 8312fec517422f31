"""Likelihoods of motion: manoeuvres integrated by scipy with formulas of their own, and laws from them."""

import numpy as np
import pytest
from scipy_flight import SCENARIO, derivatives, flown

import freqid as fq
from freqid.blend.semi_local.output_error import JoinedManeuver, OutputErrorManeuver
from freqid.blend.semi_local.problem import EstimatedManeuver
from freqid.core.errors import UsageError


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
