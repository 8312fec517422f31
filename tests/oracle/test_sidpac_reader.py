"""Real logs, read by us and by an independent reader with the unit factors typed in here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from freqid.flightlog.column_map import ChannelPlace, ColumnMap, TimePlace
from freqid.flightlog.cut import find_maneuvers
from freqid.flightlog.read import read_log
from freqid.flightlog.readers.matlab import load_variables, read_matlab
from freqid.flightlog.readers.sidpac import write_sidpac

MAPS = Path(__file__).resolve().parents[2] / "scenarios" / "maps"
DEG = 0.017453292519943295
FT = 0.3048
G = 9.80665
PSF = 47.88025898033584
SLUG = 14.593902937206364
LBF = 4.4482216152605

# channel: column counted from 1, factor to SI, first sample of totter_f1_017 as the file prints it
TOTTER = {
    "air/V": (2, FT, 241.822831),
    "air/beta": (3, DEG, -0.4329835883382785),
    "air/alpha": (4, DEG, 0.091725),
    "state/p": (5, DEG, -0.1681112155556047),
    "state/q": (6, DEG, 0.104),
    "state/r": (7, DEG, -0.8419380583634857),
    "state/phi": (8, DEG, -0.18947868363302361),
    "state/theta": (9, DEG, 0.97),
    "state/psi": (10, DEG, 240.4),
    "state/ax": (11, G, 0.008797),
    "state/ay": (12, G, -0.1088936520772311),
    "state/az": (13, G, -1.019556),
    "effector/de": (14, DEG, -0.21),
    "effector/da": (15, DEG, 0.27),
    "effector/dr": (16, DEG, 0.05),
    "air/qbar": (27, PSF, 58.6944),
    "air/rho": (29, SLUG / FT**3, 0.002007),
    "state/alt": (30, FT, 6200.9),
    "effector/thrust1": (38, LBF, 718.6),
    "effector/thrust2": (39, LBF, 713.4),
    "state/pdot": (42, DEG, 0.3),
    "state/qdot": (43, DEG, -0.65),
    "state/rdot": (44, DEG, -0.505),
    "response/CX": (61, 1.0, -0.053874781837340874),
    "response/CY": (62, 1.0, 0.001992723850195744),
    "response/CZ": (63, 1.0, -0.44889384838934426),
    "response/Cl": (64, 1.0, 7.415018835428552e-05),
    "response/Cm": (65, 1.0, -0.0017058481126989253),
    "response/Cn": (66, 1.0, -0.00021402075169913316),
    "air/phat": (71, 1.0, -0.0006543705888903342),
    "air/qhat": (72, 1.0, 2.4379996460644285e-05),
    "air/rhat": (73, 1.0, 0.0006238802030280606),
    "state/u": (74, FT, 241.816702),
    "state/v": (75, FT, -1.688227),
    "state/w": (76, FT, 0.33764),
}
FILES = ("totter_f1_017", "totter_f1_014", "totter_9752ed20")


def totter(shared_data, name="totter_f1_017"):
    return shared_data / "sidpac" / f"{name}_data.mat"


def test_the_twin_otter_record_column_by_column(shared_data):
    record = read_log(totter(shared_data))
    fdata = loadmat(totter(shared_data))["fdata"]
    assert record.time.size == 1001
    assert record.dt == pytest.approx(0.02, rel=1e-12)
    assert record.time[0] == 0.0
    assert set(record.channels) == set(TOTTER)
    for name, (column, factor, first) in TOTTER.items():
        np.testing.assert_allclose(record[name], factor * fdata[:, column - 1], rtol=1e-12, err_msg=name)
        assert record[name][0] == pytest.approx(factor * first, rel=1e-12), name
        assert record.channel(name).native_rate_hz == pytest.approx(50.0)
        assert record.channel(name).position_m is None
    about = record.provenance["sidpac"]
    assert (about["aircraft"], about["maneuver"]) == ("Twin Otter", "17")
    assert about["description"] == "0 alpha, rdr 2-1-1, ail dblet"
    assert about["clock_s"] == pytest.approx(54813.06)
    assert about["columns_not_read"] == [53, 54, 55, 67, 68, 69, 70]


def test_the_twin_otter_itself(shared_data):
    record = read_log(totter(shared_data))
    fdata = loadmat(totter(shared_data))["fdata"]
    mass = record.mass_properties
    assert mass.mass_kg == pytest.approx(fdata[:, 47].mean() * SLUG, rel=1e-9)
    assert mass.cg_m == pytest.approx((-206.1 * 0.0254, 0.7 * 0.0254, -12.3 * 0.0254), rel=1e-12)
    assert mass.inertia.xx == pytest.approx(fdata[:, 48].mean() * SLUG * FT**2, rel=1e-9)
    assert mass.inertia.xz == pytest.approx(1127.0 * SLUG * FT**2, rel=1e-9)
    vehicle = record.vehicle
    assert vehicle.name == "Twin Otter"
    assert vehicle.area_m2 == pytest.approx(422.483473 * FT**2, rel=1e-12)
    assert vehicle.span_m == pytest.approx(64.993436 * FT, rel=1e-12)
    assert vehicle.chord_m == pytest.approx(6.496063 * FT, rel=1e-12)


def test_units_and_signs_close_the_equations_of_motion(shared_data):
    """The file's coefficients are its author's own: rebuilt from our SI channels they agree.

    The mass falls by 2.6e-4 of itself in the record and its mean is used, which bounds the agreement.
    """
    r = read_log(totter(shared_data))
    mass, inertia, vehicle = r.mass_properties, r.mass_properties.inertia, r.vehicle
    qs = r["air/qbar"] * vehicle.area_m2
    np.testing.assert_allclose(mass.mass_kg * r["state/az"], qs * r["response/CZ"], rtol=2e-4)
    p, q, rr = (r[f"state/{n}"] for n in "pqr")
    roll = (
        inertia.xx * r["state/pdot"]
        - inertia.xz * (r["state/rdot"] + p * q)
        + (inertia.zz - inertia.yy) * q * rr
    )
    stored = qs * vehicle.span_m * r["response/Cl"]
    assert np.abs(roll - stored).max() < 2e-4 * np.abs(stored).max()
    wrong_sign = roll + 2 * inertia.xz * (r["state/rdot"] + p * q)
    assert np.abs(wrong_sign - stored).max() > 2e-2 * np.abs(stored).max()


@pytest.mark.parametrize("name", FILES)
def test_writing_gives_the_original_columns_back(shared_data, tmp_path, name):
    record = read_log(totter(shared_data, name))
    assert write_sidpac(record, tmp_path / "out.mat") == ()
    original, back = loadmat(totter(shared_data, name)), loadmat(tmp_path / "out.mat")
    not_read = record.provenance["sidpac"]["columns_not_read"]
    means = {48, 49, 50, 51, 52}  # mass properties are kept as their means
    for column in range(1, 91):
        theirs, ours = original["fdata"][:, column - 1], back["fdata"][:, column - 1]
        if column in not_read:
            assert not ours.any()
        elif column in means:
            np.testing.assert_allclose(ours, theirs.mean(), rtol=1e-12)
        else:
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, err_msg=f"column {column}")
    np.testing.assert_allclose(back["t"], original["t"], rtol=1e-12)
    labels = [str(x[0]).strip() if x.size else "" for x in original["fds"]["varlab"][0, 0].ravel()]
    for column in np.flatnonzero(back["fdata"].any(axis=0)):
        written = back["fds"]["varlab"][0, 0].ravel()[column][0].strip()
        assert written == labels[column], f"column {column + 1}"


def same(ours, theirs):
    """Compare a variable of ours with scipy's, down through structs and cells."""
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs)
        return all(same(ours[n], theirs[n]) for n in theirs)
    if isinstance(theirs, str):
        return ours == theirs
    theirs = np.asarray(theirs)
    if theirs.size == 0:
        return np.size(ours) == 0
    if theirs.dtype.kind == "O":
        return len(ours) == theirs.size and all(map(same, ours, theirs.ravel()))
    if theirs.dtype.kind == "U":
        return list(ours) == theirs.ravel().tolist() or ours == theirs.item()
    return bool(np.array_equal(np.ravel(ours), theirs.ravel())) and np.ndim(ours) == theirs.squeeze().ndim


def test_every_matlab_file_reads_as_scipy_reads_it(shared_data):
    paths = sorted(shared_data.glob("*/*.mat"))
    assert len(paths) >= 8
    for path in paths:
        theirs = {n: v for n, v in loadmat(path, simplify_cells=True).items() if not n.startswith("__")}
        ours = load_variables(path)
        assert set(ours) == set(theirs)
        for name in theirs:
            assert same(ours[name], theirs[name]), f"{path.name}: {name}"


@pytest.mark.parametrize("name", ["fAttasElv1", "fAttasElv2", "fAttasAil1", "fAttasRud1"])
def test_attas_by_its_map(shared_data, name):
    record = read_log(shared_data / "fvsysid" / f"{name}.mat", MAPS / "attas.toml")
    matrix = loadmat(shared_data / "fvsysid" / f"{name}.mat")[name]
    assert record.dt == pytest.approx(0.04, rel=1e-9)
    columns = {
        "state/az": (4, 1.0),
        "state/q": (8, DEG),
        "air/alpha": (13, DEG),
        "air/V": (15, 1.0),
        "state/qdot": (18, DEG),
        "effector/de": (22, DEG),
        "effector/dr": (30, DEG),
        "air/rho": (34, 1.0),
        "effector/thrust2": (38, 1.0),
    }
    for channel, (column, factor) in columns.items():
        np.testing.assert_allclose(record[channel], factor * matrix[:, column - 1], rtol=1e-12)


def test_hfb320_by_its_map(shared_data):
    path = shared_data / "fvsysid" / "hfb320_1_10.asc"
    record = read_log(path, MAPS / "hfb320.toml")
    table = np.loadtxt(path)
    np.testing.assert_array_equal(record.time, table[:, 0])
    for channel, column in {
        "effector/de": 2,
        "air/qbar": 3,
        "state/q": 8,
        "state/az": 11,
        "effector/dr": 20,
    }.items():
        np.testing.assert_array_equal(record[channel], table[:, column - 1])
    assert record["effector/de"][0] == -0.0079912


def test_the_water_tunnel_record_by_its_labels(shared_data):
    path = shared_data / "sidpac" / "f16xl_r1263e_data.mat"
    column_map = ColumnMap(
        time=TimePlace(column="time_s", unit="s"),
        labels="lab",
        channel=(
            ChannelPlace(name="air/alpha", column="alph_d", unit="deg"),
            ChannelPlace(name="state/r", column="r_dps", unit="deg/s"),
        ),
    )
    record = read_matlab(path, column_map)
    matrix = loadmat(path)["dat"]
    np.testing.assert_allclose(record["air/alpha"], DEG * matrix[:, 2], rtol=1e-12)
    np.testing.assert_allclose(record["state/r"], DEG * matrix[:, 6], rtol=1e-12)
    assert record.dt == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "first", "last"),
    [
        ("fAttasElv1", 5.68, 12.04),
        ("fAttasElv2", 31.24, 37.64),
        ("fAttasAil1", 55.72, 60.84),
        ("fAttasRud1", 116.16, 122.04),
    ],
)
def test_manoeuvres_are_found_where_the_pilot_made_them(shared_data, name, first, last):
    """`first` and `last`: where the surface is more than a degree away from its median."""
    record = read_log(shared_data / "fvsysid" / f"{name}.mat", MAPS / "attas.toml")
    spans = find_maneuvers(record)
    assert len(spans) == 1
    assert first - 3.0 < spans[0][0] < first
    assert last < spans[0][1]
