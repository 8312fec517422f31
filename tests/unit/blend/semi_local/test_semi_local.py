"""Global, semi-local and one-shot models against the regressions that they stand for, and against a truth."""

from dataclasses import replace

import numpy as np
import pytest
from blown_campaign import NAMES, TRIMS, campaign, problems_of, truth
from scipy.optimize import least_squares

from freqid.blend.semi_local.held import confident, refit, semi_local_model
from freqid.blend.semi_local.held_out import score_held_out
from freqid.blend.semi_local.one_shot import one_shot_model
from freqid.blend.semi_local.parametric import global_model
from freqid.blend.semi_local.problem import Expansion, estimated_maneuvers
from freqid.core.errors import DataError, UsageError


@pytest.fixture(scope="module")
def local():
    return campaign(3)


@pytest.fixture(scope="module")
def model(local):
    return global_model(local, vehicle="blown")


def test_clusters_and_forms_are_those_of_the_truth(model):
    assert [len(c.local.ids) for c in model.clusters] == [14, 14]
    for cluster in model.clusters:
        assert cluster["Cm.alpha"].form == "mean"
        assert cluster["Cm.de"].form != "mean"
        assert cluster["Cm.de"].unblown == pytest.approx(-1.1, abs=4 * cluster["Cm.de"].std_error)
        assert cluster["Cm.de"].increment(0.4) == pytest.approx(-0.6, rel=0.1)


def test_a_refit_is_the_regression_without_what_is_held():
    """Regression of y less the held columns, done by hand."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((80, 4)) @ rng.standard_normal((4, 4))
    y = x @ [1.0, 2.0, -1.0, 0.5] + 0.3 * rng.standard_normal(80)
    inverse = np.linalg.inv(x.T @ x)
    whole = campaign(0, trims=TRIMS[:4])
    members = whole.of(np.arange(8))
    members.estimate[:] = inverse @ x.T @ y
    members.covariance[:] = 0.09 * inverse
    cluster = global_model(members, clusters=1).clusters[0]
    again = refit(cluster, problems_of(members), ("Cm.0", "Cm.de"))
    held = [float(cluster[n].value(members.advance_ratio[0])) for n in ("Cm.0", "Cm.de")]
    by_hand, *_ = np.linalg.lstsq(x[:, 1:3], y - x[:, [0, 3]] @ held, rcond=None)
    np.testing.assert_allclose(again.estimate[0], [held[0], *by_hand, held[1]], rtol=1e-9)
    # the doubt about what is held adds to that of the regression
    alone = 0.09 * np.diag(np.linalg.inv(x[:, 1:3].T @ x[:, 1:3]))
    assert (again.std_error[0, 1:3] ** 2 > alone).all()


class Curved:
    """A manoeuvre that measures 20 exp(theta / 20): its likelihood is no parabola."""

    def __init__(self, names, estimate, information):
        self.names, self.measured, self.weight = names, 20 * np.exp(estimate / 20), information

    def _error(self, theta):
        return self.measured - 20 * np.exp(theta / 20)

    def expand(self, theta):
        slope = np.diag(np.exp(theta / 20))
        information = slope @ self.weight @ slope
        return Expansion(theta + np.linalg.solve(slope, self._error(theta)), information)

    def misfit(self, theta):
        return float(self._error(theta) @ self.weight @ self._error(theta))


def test_a_refit_of_a_curved_likelihood_is_at_its_minimum(model, local):
    cluster = model.clusters[0]
    problems = {i: Curved(p.names, p.estimate, p.information) for i, p in problems_of(local).items()}
    again = refit(cluster, problems, ("Cm.alpha",))
    problem, row = problems[cluster.local.ids[0]], again.estimate[0]
    for j in (0, 2, 3):
        for sign in (-1, 1):
            moved = row.copy()
            moved[j] += sign * 1e-3 * cluster.local.std_error[0, j]
            assert problem.misfit(moved) > problem.misfit(row)


def exponentials():
    """Estimates about laws that are exponentials, with correlated errors."""
    local = campaign(5, alphas=(0.04,), repeats=3)
    rng = np.random.default_rng(6)
    j = np.minimum(local.advance_ratio, 1e6)
    laws = np.column_stack([0.05 - 0.3 * np.exp(-4 * j), np.full(j.size, -0.9), -14 - 40 * np.exp(-4 * j),
                            -1.1 - 3 * np.exp(-4 * j)])  # fmt: skip
    errors = [np.linalg.cholesky(c) @ rng.standard_normal(4) for c in local.covariance]
    return replace(local, estimate=laws + np.array(errors))


def test_one_shot_is_the_joint_least_squares():
    local = exponentials()
    start = global_model(local, clusters=1)
    assert [law.form for law in start.clusters[0].laws.values()] == [
        "one exponential", "mean", "one exponential", "one exponential",
    ]  # fmt: skip
    found = one_shot_model(start, problems_of(local)).clusters[0]
    roots = [np.linalg.cholesky(p.information).T for p in estimated_maneuvers(local)]
    j = np.minimum(local.advance_ratio, 1e6)

    def residual(c):
        one = lambda k: c[k] + c[k + 1] * np.exp(-c[k + 2] * j)  # noqa: E731
        theta = np.column_stack([one(0), np.full(j.size, c[3]), one(4), one(7)])
        return np.concatenate([r @ off for r, off in zip(roots, theta - local.estimate, strict=True)])

    joint = least_squares(residual, [0.05, -0.3, 4, -0.9, -14, -40, 4, -1.1, -3, 4], x_scale="jac")
    error = np.sqrt(np.diag(np.linalg.inv(joint.jac.T @ joint.jac)))
    for name, k in zip(NAMES, (0, 3, 4, 7), strict=True):
        # the scatter that it estimates beside is small here, so weights and errors are nearly the same
        assert abs(found[name].unblown - joint.x[k]) < 0.3 * error[k]
        assert found[name].std_error == pytest.approx(error[k], rel=0.35)


def test_held_out_manoeuvres_are_told_better_than_by_neighbours(model, local):
    problems = problems_of(local)
    semi = semi_local_model(model, problems)
    joint = one_shot_model(model, problems)
    others = campaign(1003, 1, trims=(0.4, 0.5, 0.62, 0.8, 1.0, np.inf))
    of = problems_of(others)
    scores = score_held_out([model, semi, joint], others, of)
    assert scores.models == ("local", "global", "semi-local", "one-shot")
    assert scores.mean["global"] < scores.mean["local"] / 2
    assert scores.mean["one-shot"] < scores.mean["global"]
    # the truth itself is off by the manoeuvres' own errors alone: one by construction
    own = [of[i].misfit(truth(j, a)) / 4 for i, j, a in zip(others.ids, others.advance_ratio, others.alpha,
                                                          strict=True)]  # fmt: skip
    assert np.mean(own) == pytest.approx(1.0, abs=0.6)
    mean, error = scores.difference("one-shot", "global")
    assert mean < 0 < error
    assert scores.responses == ("Cm",)
    np.testing.assert_allclose(scores.by_response[:, 0], scores.misfit)  # of one response alone


def test_confident_laws_are_held_and_something_is_left(model, local):
    for cluster in model.clusters:
        held = confident(cluster)
        assert "Cm.alpha" in held  # a mean of 14, each as uncertain as the next
    semi = semi_local_model(model, problems_of(local))
    assert set(semi.held) < set(NAMES) or any(
        c.laws[n] is not g.laws[n] for c, g in zip(semi.clusters, model.clusters, strict=True) for n in NAMES
    )
    chosen = semi_local_model(model, problems_of(local), hold=["Cm.0"])
    assert chosen.held == ("Cm.0",)
    assert chosen.clusters[0]["Cm.0"] is model.clusters[0]["Cm.0"]
    again = chosen.clusters[0].local
    np.testing.assert_allclose(again.estimate[:, 0], chosen.clusters[0]["Cm.0"].value(again.advance_ratio))


def test_what_cannot_be_held_is_said(model, local):
    with pytest.raises(UsageError, match=r"'Cm\.d' cannot be held.*did you mean 'Cm\.de'"):
        semi_local_model(model, problems_of(local), hold=["Cm.d"])
    with pytest.raises(UsageError, match="all derivatives are held"):
        semi_local_model(model, problems_of(local), hold=NAMES)


def test_a_single_trim_gives_means_and_one_sentence():
    local = campaign(1, alphas=(0.05,), trims=(0.5,), repeats=5)
    single = global_model(local)
    assert {law.form for law in single.clusters[0].laws.values()} == {"mean"}
    assert len(single.remarks) == 1
    assert "all 5 manoeuvres are of one trim, an advance ratio of 0.502" in single.remarks[0]


def test_missing_stopped_propellers_are_one_sentence():
    local = campaign(1, alphas=(0.05,), trims=TRIMS[:5])
    assert [r for r in global_model(local).remarks if "no manoeuvre has stopped propellers" in r]


def test_a_manoeuvre_that_tells_nothing_apart_is_named():
    local = campaign(0, trims=(0.5,), alphas=(0.05,))
    local.covariance[1] = np.ones((4, 4))
    with pytest.raises(DataError, match="m1: the covariance"):
        estimated_maneuvers(local)


def test_derivatives_that_some_manoeuvres_do_not_tell_are_left_out():
    """Half of the manoeuvres move the elevator alone, the others the rest."""
    local = campaign(2, alphas=(0.05,), repeats=2)
    estimate, covariance = local.estimate.copy(), local.covariance.copy()
    estimate[::2, 2] = covariance[::2, 2, :] = covariance[::2, :, 2] = np.nan
    part = replace(local, estimate=estimate, covariance=covariance)
    model = global_model(part)
    assert model.clusters[0]["Cm.qhat"].points == 7
    problems = problems_of(part)
    assert problems["m0"].names == ("Cm.0", "Cm.alpha", "Cm.de")
    semi = semi_local_model(model, problems, hold=["Cm.alpha"])
    assert np.isnan(semi.clusters[0].local.estimate[0, 2])
    assert one_shot_model(model, problems).clusters[0]["Cm.qhat"].points == 7
