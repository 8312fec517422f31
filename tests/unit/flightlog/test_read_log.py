"""The one door: each kind of log finds its reader, or a clear refusal."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from freqid.core.errors import DataError, UsageError
from freqid.core.record import write_record
from freqid.flightlog.column_map import read_column_map
from freqid.flightlog.read import Reader, read_log, readers

MAPS = Path(__file__).resolve().parents[3] / "scenarios" / "maps"
MAP = '[time]\ncolumn = 1\nunit = "s"\n[[channel]]\nname = "state/q"\ncolumn = 2\nunit = "deg/s"\n'
TABLE = "".join(f"{0.1 * i:.1f} {i}\n" for i in range(20))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    return tmp_path


def made(folder, name, content=TABLE):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("suffix", ["csv", "CSV", "tsv", "txt", "asc", "dat"])
def test_text_tables(folder, suffix):
    record = read_log(made(folder, f"log.{suffix}"), folder / "map.toml", cut=(0.5, 1.5), resample_hz=5.0)
    np.testing.assert_allclose(record.time, [0.5, 0.7, 0.9, 1.1, 1.3, 1.5])
    np.testing.assert_allclose(record["state/q"], np.deg2rad([5, 7, 9, 11, 13, 15]), rtol=1e-9)
    assert read_log(made(folder, "x.csv"), str(folder / "map.toml")).time.size == 20
    assert read_log(made(folder, "x.csv"), read_column_map(folder / "map.toml")).time.size == 20


def test_matlab_with_a_map_and_in_the_sidpac_layout(folder):
    fdata = np.zeros((20, 90))
    fdata[:, 0], fdata[:, 1], fdata[:, 5] = 0.1 * np.arange(20), np.arange(20), 2.0
    savemat(folder / "x.mat", {"fdata": fdata})
    assert set(read_log(folder / "x.mat").channels) == {"air/V", "state/q"}
    assert set(read_log(folder / "x.mat", folder / "map.toml").channels) == {"state/q"}
    savemat(folder / "x.mat", {"fds": {"fdata": fdata}})
    assert set(read_log(folder / "x.mat").channels) == {"air/V", "state/q"}
    savemat(folder / "x.mat", {"data": fdata[:, :3]})
    with pytest.raises(UsageError, match=r"not in the SIDPAC layout and no column map is given.*data"):
        read_log(folder / "x.mat")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.xlsx", TABLE, r"kind '.xlsx' is not known, expected .csv .* or "),
        ("x.parquet", b"PAR1", "no intact Parquet file"),
        ("log", TABLE, "kind 'no suffix' is not known"),
    ],
)
def test_other_logs_are_refused_clearly(folder, name, content, said):
    path = made(folder, name, content)
    with pytest.raises(DataError, match=said) as caught:
        read_log(path, folder / "map.toml")
    assert caught.value.where == str(path)


def test_a_text_table_without_a_map_and_a_missing_file(folder):
    with pytest.raises(UsageError, match="needs a column map"):
        read_log(made(folder, "x.csv"))
    with pytest.raises(DataError, match="cannot be read"):
        read_log(folder / "none.csv", folder / "map.toml")
    with pytest.raises(DataError, match="cannot be read"):
        read_log(folder, folder / "map.toml")


def test_every_reader_of_the_folder_is_asked():
    folder = Path(__file__).resolve().parents[3] / "freqid" / "flightlog" / "readers"
    modules = [p.stem for p in folder.glob("*.py") if "\nREADER = " in p.read_text(encoding="utf-8")]
    found = [import_module(f"freqid.flightlog.readers.{name}").READER for name in modules]
    assert len(found) >= 3
    assert sorted(map(id, found)) == sorted(map(id, readers()))
    assert all(isinstance(reader, Reader) and reader.suffixes for reader in found)


def test_the_maps_beside_the_scenarios_are_valid():
    maps = sorted(MAPS.glob("*.toml"))
    assert {p.stem for p in maps} >= {"attas", "csv-example", "hfb320"}
    for path in maps:
        assert read_column_map(path).channel


def test_the_example_map_reads_what_its_words_say(folder):
    header = (
        "time_us,u_fps,wDown_fps,pitch rate (deg/s),normal_g,elevon1_deg,motor1_rpm,mass_lb,Ixx,Iyy,Izz\n"
    )
    rows = "".join(f"{20000 * i},100,1,2,1,3,3000,50,10,12,14\n" for i in range(10))
    record = read_log(made(folder, "x.csv", header + rows), MAPS / "csv-example.toml")
    assert record["state/u"][0] == pytest.approx(30.48)
    assert record["state/az"][0] == pytest.approx(-9.80665)
    assert record.channel("state/az").position_m == (0.35, 0.0, -0.08)
    assert record["effector/n1"][0] == pytest.approx(100 * np.pi)
    assert record.channel("effector/n1").native_rate_hz == 10.0
    assert record.dt == pytest.approx(0.02)
    assert record.mass_properties.mass_kg == pytest.approx(50 * 0.45359237)
    assert (record.configuration.tail, record.configuration.firmware, record.reference) == (
        "N001",
        "1.4.2",
        "hover",
    )


def test_records_of_our_own_are_cut_and_resampled(folder):
    record = read_log(made(folder, "x.csv"), folder / "map.toml")
    write_record(folder / "own.h5", record)
    again = read_log(folder / "own.h5", cut=(0.5, 1.5), resample_hz=5.0)
    np.testing.assert_allclose(again.time, [0.5, 0.7, 0.9, 1.1, 1.3, 1.5])
    np.testing.assert_allclose(again["state/q"], np.deg2rad([5, 7, 9, 11, 13, 15]), rtol=1e-9)
    assert again.provenance["cut_s"] == [0.5, 1.5]
    with pytest.raises(UsageError, match="names its channels itself"):
        read_log(folder / "own.h5", folder / "map.toml")
    with pytest.raises(DataError):
        read_log(made(folder, "broken.h5", b"no HDF5"))
