"""The global model: right at its knots, its gradient that of its wrench, and honest off the corridor."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.locate import CorridorTolerance
from freqid.core.errors import DataError, UsageError

SPEEDS = (0.0, 2.0, 5.0, 9.0, 13.0, 18.0, 25.0)
SEA, HIGH = 1.225, 1.058


def level(rho, scheduled_by="true", exact=tilt_wing.exact_point):
    """Point models at one density; tilts are those of sea level at the same true or equivalent speed."""
    points = []
    for u in SPEEDS:
        sea = tilt_wing.trim(u, SEA)
        faster = np.sqrt(SEA / rho) if scheduled_by == "equivalent" else 1.0
        at = tilt_wing.trim(u * faster, rho, sea["dw1"])
        points.append(exact(at, f"u{u:g}-{rho:g}"))
    return points


def blended(*levels, densities="apart"):
    points = [p for one in levels for p in one]
    return GlobalModel(line_up(points, [p.reference.id for p in points], densities))


@pytest.fixture(scope="module")
def one():
    return blended(level(SEA))


@pytest.fixture(scope="module")
def two():
    return blended(level(SEA), level(HIGH))


def perturbed(at, seed=0, size=1.0):
    rng = np.random.default_rng(seed)
    moved = {
        name: at[name] + size * rng.uniform(-1, 1, 5) * (20 if name[0] == "n" else 0.3)
        for name in tilt_wing.INPUTS
    }
    return {name: np.broadcast_to(v, 5) for name, v in (at | moved).items()}


def test_at_a_knot_it_is_the_point_model(two):
    for point, rho in ((level(SEA)[3], SEA), (level(HIGH)[2], HIGH)):
        at = tilt_wing.trim(point.reference.u, rho, point.reference["dw1"])
        inputs = perturbed(at) | {"u": np.full(5, at["u"])}  # speed moves it along the corridor, a little
        got = two.wrench(inputs)
        for r, values in zip(got.names, got.values, strict=True):
            m = point[r]
            x = np.array([inputs[n] for n in m.regressors]) - m.trim[:, None]
            np.testing.assert_allclose(values, m.bias + m.estimate @ x, rtol=1e-7, atol=1e-6)
            own = np.sqrt(m.bias_std_error**2 + np.einsum("ji,jk,ki->i", x, m.covariance, x))
            np.testing.assert_allclose(got.std_error[got.names.index(r)], own, rtol=1e-5)
        assert not got.outside.any()


@pytest.mark.parametrize("rho", [1.30, 1.2, 1.14, 0.9])
@pytest.mark.parametrize("u", [0.7, 4.0, 11.0, 21.0])
def test_the_gradient_is_that_of_the_wrench(two, u, rho):
    at = tilt_wing.trim(u, rho, tilt_wing.trim(u, SEA)["dw1"])
    inputs = perturbed(at, size=0.5)
    inputs["dw2"] = inputs["dw1"] + 0.01
    gradient = two.gradient(inputs)
    assert gradient.shape == (6, len(two.inputs), 5)
    for i, name in enumerate(two.inputs):
        step = 1e-5 * max(1.0, abs(float(at[name])))
        up, down = ({**inputs, name: inputs[name] + sign * step} for sign in (1, -1))
        difference = (two.wrench(up).values - two.wrench(down).values) / (2 * step)
        scale = np.abs(gradient[:, i]).max() + 1
        np.testing.assert_allclose(gradient[:, i], difference, atol=2e-5 * scale, err_msg=name)


def test_between_knots_derivatives_close_in_on_the_true_ones():
    """At a trim that was never identified: by states and effectors, and by tilt, which no point knows."""
    at = tilt_wing.trim(11.0, SEA)
    _, true = tilt_wing.derivatives(at)
    step = 1e-5
    tilted = [
        tilt_wing.loads({k: np.atleast_1d(v) for k, v in (at | dict.fromkeys(("dw1", "dw2"), tilt)).items()})
        for tilt in (at["dw1"] + step, at["dw1"] - step)
    ]
    true = np.hstack([true, (tilted[0] - tilted[1]) / (2 * step)])
    errors = []
    for spacing in (4.0, 2.0, 1.0):
        speeds = 11.0 + spacing * np.array([-1.5, -0.5, 0.5, 1.5])
        model = blended([tilt_wing.exact_point(tilt_wing.trim(u, SEA), f"{u}") for u in speeds])
        found = dict(zip(model.inputs, model.gradient(at)[..., 0].T, strict=True))
        found["tilt"] = found.pop("dw1") + found.pop("dw2")
        found = np.array([found[n] for n in (*tilt_wing.INPUTS, "tilt")]).T
        errors.append(np.linalg.norm(found - true, axis=0) / np.linalg.norm(true, axis=0))
    assert np.max(errors[1]) < 0.01
    for wide, narrow in pairwise(errors):
        assert np.linalg.norm(narrow) < np.linalg.norm(wide) / 3  # halving the spacing: order 1.6 or more


def test_similar_states_have_the_same_wrench_at_any_density(one):
    """Velocities, rates and rotor speeds by 1/sqrt(rho), angles alike: loads are then equal, exactly."""
    inputs = perturbed(tilt_wing.trim(7.0, SEA))
    higher = {n: v * np.sqrt(SEA / 0.8) if n in "uvwpqr" or n[0] == "n" else v for n, v in inputs.items()}
    higher["rho"] = np.full(5, 0.8)
    np.testing.assert_allclose(one.wrench(higher).values, one.wrench(inputs).values, rtol=1e-9)
    np.testing.assert_allclose(
        tilt_wing.loads(higher), tilt_wing.loads(inputs), rtol=1e-9
    )  # so does the truth


def test_loads_at_the_same_state_are_proportional_to_density_to_first_order(one):
    """The other statement of similarity: dz/drho = z/rho; it needs the derivatives to be consistent."""
    at = tilt_wing.trim(9.0, SEA)
    z = one.wrench(at).values[[0, 2, 4], 0]
    by_rho = one.gradient(at)[[0, 2, 4], one.inputs.index("rho"), 0]
    np.testing.assert_allclose(by_rho * SEA, z, atol=1e-3 * tilt_wing.WEIGHT)


def test_between_two_densities_a_quadratic_aircraft_is_met_exactly(monkeypatch):
    """Tangents at two trims of a quadratic, and the term of their curvature, give the quadratic."""
    rng = np.random.default_rng(3)
    Q = rng.standard_normal((6, 11, 11))

    def quadratic(at):
        x = np.array([np.broadcast_to(at[n], np.shape(at["rho"])) for n in tilt_wing.INPUTS]) / 100
        tilt = 1 + np.asarray(at["dw1"])
        velocity = np.array([0 if n[0] == "d" else 1 for n in tilt_wing.INPUTS])
        k = np.sqrt(np.asarray(at["rho"]) / SEA) ** velocity[:, None]
        return tilt * np.einsum("rij,in,jn->rn", Q, x * k, x * k)

    # A response must see all inputs for its tangent to be one.
    regressors = tilt_wing.INPUTS
    monkeypatch.setattr(tilt_wing, "loads", quadratic)
    monkeypatch.setattr(
        tilt_wing, "SETTINGS", type("All", (), {"regressors_of": staticmethod(lambda r: regressors)})
    )
    rest = {"u": 8.0, "n2": 480.0, "dw1": 0.5, "dw2": 0.5, "da": 0.1} | dict.fromkeys(
        ("v", "p", "q", "r", "dr"), 0
    )
    trims = {
        rho: rest | {"w": 1.3 - rho, "df": 0.3 * rho, "n1": 500 / rho, "rho": rho} for rho in (SEA, HIGH)
    }
    points = []
    for rho, at in trims.items():
        for u, tilt in ((8.0, 0.5), (15.0, 0.2)):
            points.append(tilt_wing.exact_point(at | {"u": u, "dw1": tilt, "dw2": tilt}, f"{u}-{rho}"))
    model = blended(points)
    middle = 0.4 * SEA + 0.6 * HIGH
    # On the straight line between the two trims, in equivalent quantities.
    k = {
        rho: np.array([np.sqrt(rho / SEA) if n[0] != "d" else 1.0 for n in tilt_wing.INPUTS])
        for rho in (SEA, HIGH, middle)
    }
    ends = {rho: np.array([trims[rho][n] for n in tilt_wing.INPUTS]) * k[rho] for rho in trims}
    x = (0.4 * ends[SEA] + 0.6 * ends[HIGH]) / k[middle]
    inputs = dict(zip(tilt_wing.INPUTS, x[:, None], strict=True)) | {
        "dw1": [0.5],
        "dw2": [0.5],
        "rho": np.array([middle]),
    }
    np.testing.assert_allclose(model.wrench(inputs).values, quadratic(inputs), rtol=1e-5, atol=1e-6)


def test_std_errors_are_those_of_a_monte_carlo(one):
    """Knots drawn again and again with their covariance, blended and evaluated anew."""
    inputs = perturbed(tilt_wing.trim(10.5, SEA), size=2.0)
    rng = np.random.default_rng(0)
    corridor = replace(one.corridor, responses={r: one.corridor[r] for r in "Z"})

    def drawn(knots):
        pairs = list(zip(knots.estimate.T, knots.covariance, strict=True))
        estimate = np.array([rng.multivariate_normal(*pair, method="cholesky") for pair in pairs]).T
        bias = knots.bias + knots.bias_std_error * rng.standard_normal(knots.bias.size)
        return replace(knots, estimate=estimate, bias=bias)

    def again():
        responses = {r: drawn(knots) for r, knots in corridor.responses.items()}
        return GlobalModel(replace(corridor, responses=responses)).wrench(inputs).values

    scatter = np.std([again() for _ in range(400)], axis=0, ddof=1)
    ratio = GlobalModel(corridor).wrench(inputs).std_error / scatter
    # 400 draws tell a standard deviation to 3.5 %; the worst of 5 may be 3 of that away.
    assert np.abs(ratio - 1).max() < 0.12
    assert abs(np.sqrt(np.mean(ratio**2)) - 1) < 0.04


def test_parameters_are_those_of_the_gradient_with_errors_of_their_own(two):
    at = two.reference([3.0, 12.0], 1.1)
    found = two.parameters("Z", at)
    gradient = two.gradient(at)[two.names.index("Z")]
    for name, row, error in zip(found.names[1:], found.estimate[1:], found.std_error[1:], strict=True):
        if name != "u":  # which says where on the corridor the aircraft is, too, by a percent
            np.testing.assert_allclose(row, gradient[two.inputs.index(name)], rtol=1e-9)
        assert (error > 0).all()
    knot = two.parameters("Z", two.reference(9.0, SEA))
    np.testing.assert_allclose(knot.std_error[1:, 0], level(SEA)[3]["Z"].std_error, rtol=1e-6)
    np.testing.assert_allclose(knot.estimate[1:, 0], level(SEA)[3]["Z"].estimate, rtol=1e-6)


def test_points_of_two_densities_make_one_line_where_tilt_follows_equivalent_speed():
    points = [p for pair in zip(level(SEA)[::2], level(HIGH, "equivalent")[1::2], strict=False) for p in pair]
    model = blended(points, densities="together")
    assert len(model.lines) == 1
    fine = blended(level(SEA))  # by similarity these are the very points of sea level
    at = model.reference(10.0, 1.1)
    np.testing.assert_allclose(at["n1"], fine.reference(10.0, 1.1)["n1"], rtol=1e-6)
    np.testing.assert_allclose(model.wrench(at).values, fine.wrench(at).values, atol=1e-4)


def test_off_the_corridor_is_refused_or_held_and_flagged(one):
    at = tilt_wing.trim(9.0, SEA)
    far = at | {"dw1": np.array([at["dw1"], at["dw1"], at["dw1"] + 0.2]), "dw2": at["dw2"]}
    with pytest.raises(DataError, match=r"1 of 3 samples are off the corridor; sample 2 has dw1 = .* deg"):
        one.wrench(far)
    held = one.wrench(far, outside="hold")
    assert held.outside.tolist() == [False, False, True]
    assert np.isfinite(held.values).all()
    fast = tilt_wing.trim(25.0, SEA) | {"u": 30.0}
    with pytest.raises(DataError, match=r"u = 30 m/s, the corridor nearby 25 m/s"):
        one.gradient(fast)
    assert GlobalModel(one.corridor, CorridorTolerance(speed=6.0)).wrench(fast).outside.tolist() == [False]


def test_beyond_the_end_parameters_are_held(one):
    end = tilt_wing.trim(25.0, SEA)
    beyond = end | {"dw1": end["dw1"] - 0.05, "dw2": end["dw2"] - 0.05}
    np.testing.assert_allclose(one.wrench(beyond).values, one.wrench(end).values)
    assert not one.gradient(beyond)[:, one.inputs.index("dw1")].any()


def test_a_corridor_without_tilt_is_scheduled_by_speed():
    """A wing that stays: the model follows speed, and its gradient is the derivative at each speed."""
    speeds = (20.0, 22.0, 24.0, 27.0)
    points = [tilt_wing.exact_point(tilt_wing.trim(u, SEA, 0.1), f"{u}") for u in speeds]
    model = blended(points)
    assert "dw1" not in model.inputs
    at = tilt_wing.trim(23.0, SEA, 0.1)
    _, true = tilt_wing.derivatives(at)
    by_u = model.gradient(at)[[0, 2, 4], model.inputs.index("u"), 0]
    np.testing.assert_allclose(by_u, true[[0, 2, 4], 0], atol=0.03 * np.abs(true[2, 0]))


def test_what_is_asked_for_wrongly_is_said(one):
    at = tilt_wing.trim(9.0, SEA)
    with pytest.raises(UsageError, match="input 'n1' is missing; the model needs u, w, q, df"):
        one.wrench({n: v for n, v in at.items() if n != "n1"})
    with pytest.raises(DataError, match=r"input 'rho' is 0\.0 at sample 0, expected a positive number"):
        one.wrench(at | {"rho": 0.0})
    with pytest.raises(DataError, match="input 'w' is nan at sample 1"):
        one.wrench(at | {"w": [0.0, np.nan]})
    with pytest.raises(DataError, match=r"u = 40 m/s is outside the corridor, which runs from 0 to 25 m/s"):
        one.reference(40.0, SEA)
    with pytest.raises(UsageError, match="no response 'Q'"):
        one.parameters("Q", at)


def test_a_throttle_stays_at_its_density():
    """Nothing says how a throttle's effect goes with density, so it is not carried."""
    points = [tilt_wing.exact_point(tilt_wing.trim(u, SEA), f"{u}") for u in (5.0, 9.0)]
    unlike = [
        replace(p, responses={"Z": replace(p["Z"], regressors=("u", "w", "q", "df", "dr", "n1", "thr"),
                                           regressor_units=(*p["Z"].regressor_units[:-1], "1"))})
        for p in points
    ]  # fmt: skip
    model = blended(unlike)
    at = tilt_wing.trim(7.0, SEA) | {"thr": 500.0}
    assert not model.wrench(at).outside.any()
    with pytest.raises(DataError, match="no law carries 'thr' from one density to another"):
        model.wrench(at | {"rho": 1.1})
