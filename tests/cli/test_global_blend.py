"""``freqid global-blend`` as a user runs it."""

import dataclasses
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import tilt_wing
from page_script import without_script

from freqid.blend.global_model import GlobalModel
from freqid.core import store
from freqid.core.record import write_record
from freqid.core.results.corridor import read_global
from freqid.core.results.point import read_point, write_point

SEA, HIGH = 1.225, 1.06
BLEND = ("global-blend", "--no-page")  # figures take longer than models


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Files of points at two densities, tilts as at sea level."""
    folder, paths = tmp_path_factory.mktemp("points"), []
    for rho in (SEA, HIGH):
        for u in (3.0, 7.0, 12.0):
            at = tilt_wing.trim(u, rho, tilt_wing.trim(u, SEA)["dw1"])
            paths.append(folder / f"u{u:g}-{rho:g}.h5")
            write_point(paths[-1], tilt_wing.exact_point(at, paths[-1].stem))
    return paths


@pytest.fixture
def points(made, tmp_path):
    """Copies of them, to be spoilt at will."""
    return [Path(shutil.copy(path, tmp_path)) for path in made]


def test_points_become_a_model_that_can_be_read_and_evaluated(freqid, points, tmp_path):
    code, out, err = freqid(*BLEND, *points, "-o", tmp_path / "g.h5", "--json")
    assert (code, err) == (0, "")
    said = json.loads(out)
    assert said["reference"]["line"] == [0, 0, 0, 1, 1, 1]
    assert said["reference"]["u"] == pytest.approx([3.0, 7.0, 12.0] * 2)
    assert {one["response"] for one in said["agreement"]} == set("XYZLMN")
    with h5py.File(tmp_path / "g.h5") as file:
        for response, figures in said["responses"].items():
            for name, columns in figures["parameters"].items():
                for key in ("estimate", "std_error"):
                    np.testing.assert_allclose(file[f"parameter/{response}/{name}/{key}"], columns[key])
    model = GlobalModel(read_global(tmp_path / "g.h5"))
    assert model.wrench(model.reference(7.0, SEA)).values[2, 0] == pytest.approx(-tilt_wing.WEIGHT, rel=1e-6)


def test_the_text_says_lines_agreement_and_where_it_is(freqid, points, tmp_path):
    code, out, _ = freqid(*BLEND, *points, "-o", tmp_path / "g.h5")
    assert code == 0
    assert "line 1: 3 points, u 3 to 12 m/s, rho 1.06 kg/m3" in out
    assert "Z: rho 1.225 against 1.06 kg/m3 at 3 points: chi-square" in out
    assert out.rstrip().endswith("g.h5")


def reconstructable(at, seed):
    """A manoeuvre whose motion has the wrench in it: specific force and acceleration from the loads."""
    flight = tilt_wing.fly(at, seed, noise=0.0)
    record, mass = flight.record, tilt_wing.VEHICLE.mass_properties
    channels = dict(record.channels)
    for axis, r in zip(("ax", "ay", "az"), "XYZ", strict=True):
        values = record[f"response/{r}"] / mass.mass_kg
        channels[f"state/{axis}"] = replace(
            channels["state/u"], name=f"state/{axis}", unit="m/s2", values=values
        )
    return replace(record, channels={n: c for n, c in channels.items() if not n.startswith("response/")})


def test_a_held_out_record_is_predicted(freqid, points, tmp_path):
    record = reconstructable(tilt_wing.trim(9.0, SEA), 5)
    write_record(tmp_path / "r.h5", record)
    for u in (8.0, 10.0):
        write_point(tmp_path / f"{u}.h5", tilt_wing.exact_point(tilt_wing.trim(u, SEA), f"u{u}"))
    near = (tmp_path / "8.0.h5", tmp_path / "10.0.h5")
    arguments = (
        "global-blend",
        "--no-page",
        *points[:3],
        *near,
        "-o",
        tmp_path / "g.h5",
        "--predict",
        tmp_path / "r.h5",
    )
    code, out, err = freqid(*arguments, "--json")
    assert (code, err) == (0, "")
    said = json.loads(out)["prediction"]
    assert said["X"]["r2"] > 0.95
    assert said["Y"]["r2"] > 0.95
    assert abs(said["Z"]["mean"]) < said["Z"]["rmse"] < 0.01 * tilt_wing.WEIGHT
    assert "predicted R2" in freqid(*arguments)[1]


def test_the_page_of_a_global_model_shows_points_intervals_and_a_predicted_flight(freqid, points, tmp_path):
    write_record(tmp_path / "r.h5", reconstructable(tilt_wing.trim(9.0, SEA), 5))
    code, out, _ = freqid("global-blend", *points, "-o", tmp_path / "g.h5")
    assert code == 0
    assert str(tmp_path / "g.html") in out
    alone = (tmp_path / "g.html").read_text(encoding="utf-8")
    assert "No flight was held out" in alone
    assert "Do the densities agree?" in alone
    assert "http" not in without_script(alone)  # it fetches nothing
    knots = read_global(tmp_path / "g.h5")
    rows = re.findall(r'<th scope="row"><code>(\S+)</code></th>.*<td class="words">(\S+)</td></tr>', alone)
    assert [Path(file).stem for _, file in rows] == [identifier for identifier, _ in rows] == list(knots.ids)
    value = float(knots["M"].estimate[knots["M"].regressors.index("df"), 0])
    assert f'<data value="{value!r}">' in alone
    report = ("report", tmp_path / "g.h5", "-o", tmp_path / "p.html")
    assert freqid(*report)[0] == 0
    assert (tmp_path / "p.html").read_text(encoding="utf-8") == alone
    assert freqid(*report, "--record", tmp_path / "r.h5")[0] == 0
    held = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "r.h5" in held
    assert "No flight was held out" not in held
    assert "A flight that no point is made from" in held


def test_a_record_off_the_corridor_is_named_and_can_be_held(freqid, points, tmp_path):
    write_record(tmp_path / "r.h5", reconstructable(tilt_wing.trim(9.0, SEA, 0.9), 5))
    arguments = (
        "global-blend",
        "--no-page",
        *points[:3],
        "-o",
        tmp_path / "g.h5",
        "--predict",
        tmp_path / "r.h5",
    )
    code, _, err = freqid(*arguments)
    assert code == 3
    assert err.startswith(f"freqid: {tmp_path}/r.h5: ")
    assert "off the corridor" in err
    assert not (tmp_path / "g.h5").exists()
    assert freqid(*arguments, "--outside", "hold")[0] == 0


def rewritten(**changes):
    """Return what writes the second point again, changed."""
    return lambda paths: write_point(paths[1], replace(read_point(paths[1]), **changes))


def tilted(paths):
    write_point(paths[1], tilt_wing.exact_point(tilt_wing.trim(7.0, SEA, 0.3), "u7"))


def newer(paths):
    with store.editing(paths[0]) as file:
        file.attrs["version"] = "9.0"


def without_n2(paths):
    model = read_point(paths[1])
    z = model["Z"]
    last = z.regressors.index("n2")
    assert last == len(z.regressors) - 1
    changes = {}
    for field in dataclasses.fields(z):
        value = getattr(z, field.name)
        if isinstance(value, np.ndarray):
            changes[field.name] = value[(slice(last),) * value.ndim]
        elif field.name in ("regressors", "regressor_units"):
            changes[field.name] = value[:last]
    write_point(paths[1], replace(model, responses={**model.responses, "Z": replace(z, **changes)}))


BAD = {  # how many points, what is done to them, exit code, what is said
    "one point": (1, None, 2, "needs two point models or more, found 1"),
    "the same twice": (-1, None, 3, "u7-1.225.h5: reference 'u7-1.225'"),
    "other vehicle": (3, rewritten(vehicle="other"), 3, "u7-1.225.h5: has the vehicle 'other'"),
    "other form": (3, rewritten(form="specific"), 3, "u7-1.225.h5: has the form 'specific'"),
    "other axes": (3, rewritten(axes="stability"), 3, "u7-1.225.h5: is a model in stability axes"),
    "other regressors": (3, without_n2, 3, "u7-1.225.h5: has regressors of 'Z'"),
    "off the line": (3, tilted, 3, "is off the corridor"),
    "newer": (3, newer, 3, "u3-1.225.h5: layout version 9.0 is newer than"),
    "missing": (3, lambda paths: paths[0].unlink(), 3, "u3-1.225.h5: no such file"),
    "no point": (3, lambda paths: paths[0].write_text("no"), 3, "u3-1.225.h5: is no readable HDF5 file"),
    "lonely density": (4, None, 3, "u3-1.06.h5: is the only point at 1.06 kg/m3"),
}


@pytest.mark.parametrize("fault", BAD)
def test_bad_points_end_in_one_sentence_and_no_file(freqid, points, tmp_path, fault):
    count, spoil, expected, sentence = BAD[fault]
    chosen = [*points[:3], points[1]] if count < 0 else points[:count]
    if spoil:
        spoil(points)
    code, out, err = freqid(*BLEND, *chosen, "-o", tmp_path / "g.h5")
    assert code == expected
    assert out == ""
    assert sentence in err
    assert err.count("\n") == 1
    assert not Path(tmp_path / "g.h5").exists()


def test_it_does_not_write_over_its_own_points(freqid, points):
    before = points[1].read_bytes()
    code, _, err = freqid("global-blend", *points, "-o", points[1])
    assert (code, points[1].read_bytes()) == (2, before)
    assert "would replace its own input" in err


def test_the_result_must_be_named(freqid, points):
    code, _, err = freqid("global-blend", *points)
    assert code == 2
    assert "'-o'" in err
