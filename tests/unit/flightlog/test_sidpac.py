"""The SIDPAC layout, both ways, on a record made for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.flightlog.readers.sidpac import CHANNELS, GEOMETRY, MASS, SPARE, read_sidpac, write_sidpac

N = 60
MASS_PROPERTIES = MassProperties(
    mass_kg=30.0, cg_m=(-1.2, 0.02, -0.3), inertia=Inertia(xx=2.0, yy=3.0, zz=4.0, xz=0.1)
)
VEHICLE = Vehicle(name="tandem", mass_properties=MASS_PROPERTIES, area_m2=1.4, span_m=2.1, chord_m=0.35)


def channel(name, unit, seed, **more):
    values = np.random.default_rng(seed).normal(size=N)
    return Channel(name=name, unit=unit, values=values, native_rate_hz=50.0, source="test", **more)


@pytest.fixture
def record():
    channels = [
        channel("state/u", "m/s", 1),
        channel("state/p", "rad/s", 2),
        channel("state/ax", "m/s2", 3),
        channel("state/az", "m/s2", 4, position_m=(0.1, 0.0, -0.2)),
        channel("air/qbar", "Pa", 5),
        channel("effector/de", "rad", 6),
        channel("effector/dw1", "rad", 7),
        channel("effector/n1", "rad/s", 8),
        channel("command/de", "rad", 9),
        channel("response/X", "N", 10),
        channel("response/Cm", "1", 11),
    ]
    return FlightRecord(
        time=100 + 0.02 * np.arange(N), channels={c.name: c for c in channels}, vehicle=VEHICLE
    )


def test_the_table_is_consistent():
    numbers = [n for n, *_ in (*CHANNELS, *MASS, *GEOMETRY)] + list(SPARE)
    assert len(set(numbers)) == len(numbers)
    assert set(numbers) <= set(range(2, 91))
    assert len({row[3] for row in CHANNELS}) == len(CHANNELS)


def test_what_is_written_is_in_sidpacs_units(record, tmp_path):
    path = tmp_path / "out.mat"
    left_out = write_sidpac(record, path)
    assert left_out == ("command/de", "response/X")
    found = loadmat(path)
    fdata = found["fdata"]
    assert fdata.shape == (N, 90)
    assert found["t"].shape == (N, 1)
    assert found["dt"].item() == pytest.approx(0.02)
    for column, expected in {
        1: record.time,
        74: record["state/u"] / 0.3048,
        5: np.rad2deg(record["state/p"]),
        11: record["state/ax"] / 9.80665,
        55: record["state/az"] / 9.80665,  # not at the centre of gravity: as measured
        13: np.zeros(N),
        27: record["air/qbar"] / 47.88025898,
        14: np.rad2deg(record["effector/de"]),
        19: np.rad2deg(record["effector/dw1"]),
        20: record["effector/n1"],
        65: record["response/Cm"],
        45: np.full(N, 1.2 / 0.0254),
        46: np.full(N, 0.02 / 0.0254),
        47: np.full(N, 0.3 / 0.0254),
        48: np.full(N, 30 / 14.59390294),
        50: np.full(N, 3 / 1.3558179483),
        52: np.full(N, 0.1 / 1.3558179483),
        77: np.full(N, 1.4 / 0.3048**2),
        78: np.full(N, 2.1 / 0.3048),
        79: np.full(N, 0.35 / 0.3048),
    }.items():
        np.testing.assert_allclose(fdata[:, column - 1], expected, rtol=1e-9, err_msg=f"column {column}")
    used = {1, 74, 5, 11, 55, 27, 14, 19, 20, 65, *range(45, 53), 77, 78, 79}
    assert set(np.flatnonzero(fdata.any(axis=0)) + 1) == used
    fds = found["fds"][0, 0]
    assert fds["aircraft"].item() == "tandem"
    assert [fds["varlab"][i, 0].item().strip() for i in (13, 18, 19)] == ["el", "dw1", "n1"]
    assert fds["varunits"][19, 0].item().strip() == "(rad/s)"


def test_a_record_comes_back(record, tmp_path):
    path = tmp_path / "out.mat"
    left_out = write_sidpac(record, path)
    back = read_sidpac(path)
    np.testing.assert_allclose(back.time, record.time, rtol=1e-15)
    assert set(back.channels) == set(record.channels) - set(left_out) - {"state/az"}
    for name, found in back.channels.items():
        np.testing.assert_allclose(found.values, record[name], rtol=1e-12)
        assert found.unit == record.channel(name).unit
    assert back.mass_properties.cg_m == pytest.approx(MASS_PROPERTIES.cg_m, rel=1e-12)
    assert back.mass_properties.inertia.xz == pytest.approx(0.1, rel=1e-12)
    assert (back.vehicle.name, back.vehicle.chord_m) == ("tandem", pytest.approx(0.35, rel=1e-12))
    assert back.provenance["sidpac"]["columns_not_read"] == [55]


def test_accelerometers_stated_at_the_centre_of_gravity_count_as_there(record, tmp_path):
    moved = replace(record.channel("state/az"), position_m=MASS_PROPERTIES.cg_m)
    write_sidpac(record.with_channels(moved), tmp_path / "out.mat")
    np.testing.assert_allclose(read_sidpac(tmp_path / "out.mat")["state/az"], record["state/az"], rtol=1e-12)


def test_effectors_beyond_the_spare_columns_are_left_out_by_name(record, tmp_path):
    many = record.with_channels(*(channel(f"effector/n{i}", "rad/s", i) for i in range(2, 30)))
    left_out = write_sidpac(many, tmp_path / "out.mat")
    beyond = tuple(f"effector/n{i}" for i in range(len(SPARE), 30))
    assert left_out == ("command/de", "response/X", *beyond)
    assert set(read_sidpac(tmp_path / "out.mat").group("effector")) == {"de", "dw1"} | {
        f"n{i}" for i in range(1, len(SPARE))
    }


def test_a_given_vehicle_is_kept(record, tmp_path):
    write_sidpac(record, tmp_path / "out.mat")
    other = Vehicle(name="other", mass_properties=MASS_PROPERTIES)
    assert read_sidpac(tmp_path / "out.mat", vehicle=other).vehicle is other


def test_without_mass_there_is_no_vehicle(record, tmp_path):
    write_sidpac(replace(record, vehicle=None), tmp_path / "out.mat")
    back = read_sidpac(tmp_path / "out.mat")
    assert back.vehicle is None
    assert back.mass_properties is None


def altered(record, tmp_path, change):
    path = tmp_path / "out.mat"
    write_sidpac(record, path)
    found = {n: v for n, v in loadmat(path).items() if not n.startswith("__")}
    change(found)
    savemat(path, found)
    return path


def test_the_matrix_alone_is_enough(record, tmp_path):
    def strip(found):
        for name in ("t", "dt", "fds"):
            del found[name]

    back = read_sidpac(altered(record, tmp_path, strip))
    np.testing.assert_allclose(back.time, record.time)
    assert "effector/de" in back
    assert "effector/dw1" not in back
    assert back.provenance["sidpac"]["columns_not_read"] == [19, 20, 55]
    assert back.vehicle.name == "unnamed"


def test_a_spare_column_that_is_no_effector_is_left_and_listed(record, tmp_path):
    def heat(found):
        found["fds"][0, 0]["varunits"][18, 0] = " (degC) "
        found["fds"][0, 0]["varunits"][19, 0] = " (furlong) "

    back = read_sidpac(altered(record, tmp_path, heat))
    assert back.group("effector") == ("de",)
    assert back.provenance["sidpac"]["columns_not_read"] == [19, 20, 55]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda f: f["fds"][0, 0]["varunits"].__setitem__((13, 0), " (rad) "),
            r"column 14 \(el\) is labelled in 'rad'",
        ),
        (lambda f: f.update(dt=0.04), "dt is 0.04 s, but t advances by 0.02 s"),
        (lambda f: f.update(t=f["t"][:-1]), r"t has shape \(59,\), fdata has 60 samples"),
        (lambda f: f.update(fdata=f["fdata"][:, :89]), "holds no fdata with 90 columns"),
        (lambda f: f["fdata"].__setitem__((5, 4), np.nan), "'state/p' is not finite"),
        (lambda f: f["fdata"].__setitem__((slice(None), 48), 1e6), "mass properties do not fit together"),
    ],
)
def test_a_file_that_contradicts_the_layout_is_refused(record, tmp_path, change, said):
    path = altered(record, tmp_path, change)
    with pytest.raises(DataError, match=said) as caught:
        read_sidpac(path)
    assert caught.value.where == str(path)


def test_units_in_another_spelling_are_the_same(record, tmp_path):
    def spell(found):
        found["fds"][0, 0]["varunits"][4, 0] = " (deg/sec) "
        found["fds"][0, 0]["varunits"][73, 0] = " (ft/s) "

    np.testing.assert_allclose(read_sidpac(altered(record, tmp_path, spell))["state/p"], record["state/p"])


def test_a_folder_that_cannot_be_written_leaves_nothing(record, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_sidpac(record, tmp_path / "file" / "out.mat")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_the_documented_table_is_the_one_in_use():
    page = (Path(__file__).resolve().parents[3] / "docs" / "flight-logs.md").read_text()
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in page.splitlines()
        if line.startswith("| ")
    ]
    documented = {row[0]: row for row in rows if row[0].isdecimal()}
    for number, label, unit, ours in CHANNELS:
        assert documented[str(number)][1:4] == [label or "(blank)", unit or "-", f"`{ours}`"]
    for number, label, unit, ours, _ in MASS:
        assert documented[str(number)][1:3] == [label, unit]
        assert f"`{ours}`" in documented[str(number)][3]
    assert len(documented) == 1 + len(CHANNELS) + len(MASS) + len(GEOMETRY)
