"""Which points make a corridor, and what is said of those that do not."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line import turns
from freqid.blend.line_up import line_up
from freqid.cli.blend_texts import blend_table
from freqid.core.errors import DataError, UsageError
from freqid.core.results.corridor import read_global, write_global
from freqid.views.figures import figure_of

SEA = 1.225


def point(u, tilt=None, rho=SEA, id=None):
    at = tilt_wing.trim(u, SEA)
    at = tilt_wing.trim(u, rho, at["dw1"] if tilt is None else tilt)
    return tilt_wing.exact_point(at, id or f"u{u:g}")


@pytest.fixture(scope="module")
def points():
    return [point(u) for u in (12.0, 3.0, 7.0)]


def refused(points, match, kind=DataError, **options):
    with pytest.raises(kind, match=match) as caught:
        line_up(points, [f"{i}.h5" for i in range(len(points))], **options)
    assert "\n" not in str(caught.value)


def moved(p, **changes):
    return replace(p, reference=msgspec.structs.replace(p.reference, **changes))


def test_points_are_sorted_by_speed_whatever_their_order(points):
    corridor = line_up(points, ["a", "b", "c"])
    assert corridor.ids == ("u3", "u7", "u12")
    assert (np.diff(corridor.u) > 0).all()
    assert list(corridor.provenance["points"]) == ["b", "c", "a"]
    for k, i in enumerate((1, 2, 0)):
        assert corridor["Z"].bias[k] == points[i]["Z"].bias
        np.testing.assert_array_equal(corridor["Z"].estimate[:, k], points[i]["Z"].estimate)
        np.testing.assert_array_equal(corridor["Z"].covariance[k], points[i]["Z"].covariance)


def test_regressors_may_come_in_another_order(points):
    z = points[2]["Z"]
    back = list(range(len(z.regressors)))[::-1]
    turned = replace(
        z,
        regressors=z.regressors[::-1],
        regressor_units=z.regressor_units[::-1],
        covariance=z.covariance[np.ix_(back, back)],
        **{f: getattr(z, f)[::-1] for f in ("trim", "regressor_rms", "estimate", "std_error")},
    )
    other = [*points[:2], replace(points[2], responses={**points[2].responses, "Z": turned})]
    expected, found = (line_up(p, "abc")["Z"] for p in (points, other))
    assert found.regressors == expected.regressors
    np.testing.assert_array_equal(found.estimate, expected.estimate)
    np.testing.assert_array_equal(found.covariance, expected.covariance)


def test_densities_make_lines_of_their_own_or_one():
    both = [point(u, rho=rho, id=f"{u}-{rho}") for rho in (1.06, SEA) for u in (3.0, 7.0, 12.0)]
    corridor = line_up(both, "abcdef")
    assert corridor.line.tolist() == [0, 0, 0, 1, 1, 1]
    assert corridor.rho.tolist() == [1.06] * 3 + [SEA] * 3
    scattered = [point(u, rho=rho) for u, rho in ((3.0, 1.215), (7.0, 1.235), (12.0, 1.225))]
    assert not line_up(scattered, "abc").line.any()
    one = line_up(
        [point(u, rho=rho) for u, rho in ((3.0, 1.06), (7.0, SEA), (12.0, 1.06))], "abc", "together"
    )
    assert not one.line.any()


def test_too_few_points_is_a_bad_request(points):
    refused(points[:1], "needs two point models or more, found 1; name", UsageError)


def test_points_of_different_kinds_are_refused(points):
    first, second, third = points
    refused(
        [first, replace(second, vehicle="other")],
        r"1.h5: has the vehicle 'other', expected 'tilt-wing' as in 0.h5",
    )
    refused([first, replace(second, form="specific")], r"1.h5: has the form 'specific', expected 'force'")
    refused([first, replace(second, axes="stability")], r"1.h5: is a model in stability axes")
    fewer = {r: m for r, m in second.responses.items() if r != "N"}
    refused([first, replace(second, responses=fewer)], r"1.h5: has responses X Y Z L M, expected X Y Z L M N")
    renamed = replace(second["Z"], regressors=("u", "w", "q", "df", "dr", "n1", "n3"))
    refused(
        [first, replace(second, responses={**second.responses, "Z": renamed})],
        r"regressors of 'Z' with n3 \[rad/s\] and without n2 \[rad/s\], expected the same as in 0.h5",
    )
    broken = replace(second["Z"], covariance=second["Z"].covariance * np.nan)
    refused([first, replace(second, responses={**second.responses, "Z": broken})], "1.h5: response 'Z' holds")


def test_a_point_without_a_place_is_refused(points):
    refused(
        [points[0], moved(points[1], u=float("nan"))], r"1.h5: reference 'u3' has u = nan, so it has no place"
    )
    refused([points[0], moved(points[1], rho=0.0)], "has rho = 0")


def test_a_condition_that_comes_twice_is_refused(points):
    refused(
        [*points, point(7.0, id="again")], r"3.h5: reference 'again' .* repeats .* 'u7' in 2.h5; keep one"
    )
    refused([*points, point(7.0, tilt=0.9, id="again")], r"with tilts .* deg apart")


def test_a_point_off_the_line_is_refused(points):
    refused(
        [*points, point(5.0), point(15.0), point(9.0, tilt=0.9)],
        r"5.h5: reference 'u9' is off the corridor of the other points: at u = 9 m/s its dw1 of 51.57 deg",
    )


def test_a_density_of_one_point_makes_no_line(points):
    refused(
        [*points, point(9.0, rho=1.0)], r"3.h5: is the only point at 1 kg/m3, and one point makes no line"
    )


def test_a_throttle_is_not_carried_to_another_density(points):
    def unlike(p):
        z = replace(
            p["Z"],
            regressors=(*p["Z"].regressors[:-1], "thr"),
            regressor_units=(*p["Z"].regressor_units[:-1], "1"),
        )
        return replace(p, responses={"Z": z})

    both = [unlike(p) for p in (*points, *(point(u, rho=1.06) for u in (3.0, 7.0)))]
    refused(both, r"3.h5: is at 1.06 kg/m3 and 0.h5 at 1.225, but no law carries regressor 'thr'")
    assert line_up([unlike(p) for p in points], "abc").units["thr"] == "1"


def test_points_of_one_speed_lie_along_what_is_set(points):
    """Points of one speed differ in what is set; a corridor of several speeds may run along it if asked."""
    at = [
        moved(replace(point(u), responses=point(u).responses), u=9.0, scheduled={"flap": x, "dw1": 0.5})
        for u, x in ((8.0, 0.7), (8.5, 0.3), (9.0, 0.5))
    ]
    corridor = line_up(at, "abc")
    assert (corridor.along, corridor.ids) == ("flap", ("u8.5", "u9", "u8"))
    model = GlobalModel(corridor)
    middle = model.reference(0.5, SEA)
    assert middle["flap"][0] == pytest.approx(0.5)
    assert middle["dw1"][0] == pytest.approx(0.5)
    found = model.parameters("Z", middle)
    np.testing.assert_allclose(found.estimate[1:, 0], corridor["Z"].estimate[:, 1], rtol=1e-9)
    assert {"u", "flap", "rho"} <= set(model.inputs)
    assert "dw1" not in model.inputs  # it does not move
    assert line_up(points, "abc").along == "u"
    by_tilt = line_up(points, "abc", along="dw1")
    assert (np.diff(by_tilt.schedule[0]) > 0).all()
    assert by_tilt.ids == line_up(points, "abc").ids[::-1]  # the wings come down as the aircraft gets faster


def test_the_gradient_along_a_scheduled_variable_is_that_of_the_wrench(points):
    model = GlobalModel(line_up(points, "abc", along="dw1"))
    at = model.reference(np.array([0.6, 0.8]), SEA)
    step = 1e-5
    for name in ("dw1", "u", "w"):
        up, down = (model.wrench(at | {name: at[name] + sign * step}).values for sign in (1, -1))
        slope = model.gradient(at)[:, model.inputs.index(name)]
        np.testing.assert_allclose(
            slope, (up - down) / (2 * step), rtol=1e-4, atol=1e-4 * np.abs(slope).max()
        )


def test_a_variable_that_points_do_not_set_is_refused(points):
    refused(points, r"the points set no 'dw3' .* did you mean 'dw2' or 'dw1'", UsageError, along="dw3")


def test_what_has_another_unit_counts_by_its_range(points):
    """A flap in degrees is the same corridor as one in radians is, along what its range makes of it."""
    at = [
        replace(moved(p, scheduled={"n": 100 * p.reference["dw1"]}), scheduled_units={"n": "rad/s"})
        for p in points
    ]
    corridor = line_up(at, "abc")
    assert corridor.scheduled_units == ("rad/s",)
    assert turns(corridor) * np.ptp(corridor.schedule) == pytest.approx(np.pi / 2)
    model = GlobalModel(corridor)
    with pytest.raises(DataError, match=r"n = .* rad/s, the corridor nearby"):
        model.wrench(model.reference(7.0, 1.1) | {"n": np.array([100.0])} | {"rho": np.array([1.1])})


def test_a_corridor_along_a_tilt_is_kept_drawn_and_told_so(points, tmp_path):
    corridor = line_up(points, "abc", along="dw1")
    write_global(tmp_path / "g.h5", corridor)
    back = read_global(tmp_path / "g.h5")
    assert (back.along, back.scheduled, back.scheduled_units) == ("dw1", ("dw1", "dw2"), ("rad", "rad"))
    np.testing.assert_array_equal(back.coordinate, corridor.coordinate)
    axes = figure_of(back).axes[0]
    assert axes.get_xlabel() == "dw1 (rad)"
    np.testing.assert_array_equal(axes.lines[1].get_xdata(), corridor.schedule[0])
    assert "along dw1 0.5165 to 0.9505 rad, rho" in blend_table(back, [], {})


def test_a_corridor_of_an_aircraft_that_sets_nothing_is_kept(points, tmp_path):
    corridor = line_up([moved(p, scheduled={}) for p in points], "abc")
    assert corridor.schedule.shape == (0, 3)
    write_global(tmp_path / "g.h5", corridor)
    back = read_global(tmp_path / "g.h5")
    assert (back.scheduled, back.schedule.shape) == ((), (0, 3))
    at = GlobalModel(back).reference(7.0, SEA)
    assert GlobalModel(back).wrench(at).values.shape == (6, 1)
