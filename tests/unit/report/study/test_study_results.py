"""Figures of merit of a study against slow and plain counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_study_page import DENSITIES, results

from freqid.blend.corridor_study import HeldOut, rmse_inside, same_density, spanning_conditions
from freqid.core.results.fit import Fit
from freqid.core.scenario import Reference
from freqid.identify.in_flight.parameter_history import ParameterHistory
from freqid.report.study.results import densities, settled, settled_share


def history(estimate: np.ndarray, std_error: np.ndarray, start: float = 10.0) -> ParameterHistory:
    k = estimate.shape[0]
    time = start + np.arange(k)
    names = tuple("abcdef"[: estimate.shape[1]])
    around = dict.fromkeys(("estimate", "lower", "upper"), estimate)
    none = dict.fromkeys(("bias", "bias_std_error", "r2"), np.zeros(k))
    return ParameterHistory(
        response="Z",
        unit="N",
        regressors=names,
        regressor_units=("rad",) * len(names),
        time=time,
        std_error=std_error,
        **around,
        **none,
    )


def test_a_parameter_that_leaves_again_has_not_settled_before():
    estimate = np.array([[0.0, 1.0], [1.9, 1.0], [-2.5, 1.0], [0.0, 1.0]])
    assert settled(history(estimate, np.ones((4, 2)))).tolist() == [
        [False, True],
        [False, True],
        [False, True],
        [True, True],
    ]


def test_settling_is_counted_as_a_loop_counts_it():
    rng = np.random.default_rng(3)
    walks = [np.cumsum(rng.standard_normal((30, 4)), axis=0)[::-1] for _ in range(2)]
    histories = {
        "Z": history(walks[0], 0.8 + rng.random((30, 4))),
        "N": history(walks[1][5:], 0.8 + rng.random((25, 4)), start=15.0),
    }
    time, share = settled_share(histories)
    expected = []
    for i in range(25):  # the shorter history says where all are known
        count = 0
        for h in histories.values():
            rest = h.estimate[len(h.time) - 25 + i :]
            for j in range(4):
                count += bool(all(abs(rest[:, j] - h.estimate[-1, j]) <= 2 * h.std_error[-1, j]))
        expected.append(count / 8)
    assert share.tolist() == expected
    assert (time[0], time[-1], share[-1]) == (15.0, 39.0, 1.0)


def test_the_ends_of_a_history_and_its_mean_do_not_count():
    t = np.arange(500) * 0.02
    residual = 3.0 + 0.5 * np.sin(2 * np.pi * t)
    residual[:40] += 7
    residual[-40:] -= 5
    fit = Fit(t, residual, np.zeros(500))
    inside = residual[50:-50]  # two periods of 2 Hz at 50 Hz
    expected = np.sqrt(np.mean((inside - inside.mean()) ** 2))
    assert rmse_inside(fit, 2.0) == pytest.approx(expected, rel=1e-12)
    assert rmse_inside(fit) == pytest.approx(residual.std(), rel=1e-12)
    assert rmse_inside(fit, 0.3) == rmse_inside(fit)  # too short to spare its ends


def test_held_out_errors_are_compared_where_both_are_known():
    at = Reference(id="a", u=1.0, rho=1.0)
    held_out = HeldOut(at, {"Z": 3.0, "N": 1.0, "M": 1.0}, {"Z": 2.0, "N": 0.0})
    assert held_out.ratio("Z") == 1.5
    assert np.isnan(held_out.ratio("N"))
    assert np.isnan(held_out.ratio("M"))
    assert np.isnan(held_out.ratio("L"))


def test_densities_within_two_percent_are_one():
    made = results()
    shifted = []
    for point, rho in zip(made.points, (1.225, 1.21, 1.20, 1.0, 1.01, 0.99), strict=True):
        model = replace(point.model, reference=Reference(id=point.id, u=1.0, rho=rho))
        shifted.append(replace(point, model=model))
    assert densities(tuple(shifted)) == [1.225, 1.2, 1.01]
    assert same_density(float("nan"), 1.2)


def test_three_conditions_are_followed_and_those_with_a_history_first():
    made = results()
    assert [p.id for p in made.followed()] == ["u8-1.225", "u14-1.225", "u20-1.225"]
    without = replace(made, points=tuple(replace(p, history={}) for p in reversed(made.points)))
    followed = [(p.model.reference.u, p.model.reference.rho) for p in without.followed()]
    assert followed == [(u, DENSITIES[0]) for u in (8.0, 14.0, 20.0)]
    one = replace(made, points=(made.points[1], *made.points[3:]))
    assert [p.id for p in one.followed()] == ["u14-1.225"]


def test_conditions_in_detail_differ_in_speed_and_not_in_density():
    speeds = (0.0, 20.0, 5.0, 10.0, 15.0)
    sea = [Reference(id=f"s{u:g}", u=u, rho=1.225) for u in speeds]
    high = [Reference(id=f"h{u:g}", u=u, rho=1.058) for u in speeds]

    def chosen(references):
        return [references[i].id for i in spanning_conditions(references)]

    assert chosen([*high, *sea]) == ["s0", "s10", "s20"]
    assert chosen([*sea[:2], *high]) == ["s0", "h10", "h20"]  # two at the densest air are too few
    assert chosen(sea[3:4]) == ["s10"]
    assert chosen(sea[1:3]) == ["s5", "s20"]


def test_the_distance_from_the_linearised_simulation_is_in_standard_errors():
    point = results().points[0]
    found = point.model["Z"]
    away = found.estimate - 2.5 * found.std_error
    linear = {"Z": dict(zip(found.regressors, away.tolist(), strict=True))}
    del linear["Z"]["q"]
    apart = replace(point, linear=linear).from_linear("Z")
    assert np.isnan(apart[found.regressors.index("q")])
    assert np.delete(apart, found.regressors.index("q")) == pytest.approx(np.full(5, 2.5))
    assert np.isnan(replace(point, linear=linear).from_linear("N")).all()
