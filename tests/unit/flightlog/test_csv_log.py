"""Text tables: every dialect gives the same record, every fault is said with its place."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, MassPlace, TimePlace
from freqid.flightlog.readers.csv import read_csv

TIME = TimePlace(column="t", unit="s")
U = ChannelPlace(name="state/u", column="u", unit="ft/s", sign=-1)
DE = ChannelPlace(name="effector/de1", column="de", unit="deg")
MAP = ColumnMap(time=TIME, channel=(U, DE))
HEADER = ("t", "u", "de")
ROWS = [(0.02 * i, 10.0 + i, -3.0 * i) for i in range(8)]


def table(rows=ROWS, header=HEADER, delimiter=",", end="\n"):
    lines = [delimiter.join(header)] if header else []
    lines += [delimiter.join(x if isinstance(x, str) else f"{x:.12g}" for x in row) for row in rows]
    return end.join(lines) + end


def written(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(tmp_path, content, column_map=MAP, **options):
    return read_csv(written(tmp_path, content), column_map, **options)


def with_cell(row, column, text):
    rows = [list(r) for r in ROWS]
    rows[row][column] = text
    return rows


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "   "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_dialect_gives_the_same_record(tmp_path, delimiter, end):
    record = read(tmp_path, table(delimiter=delimiter, end=end))
    np.testing.assert_allclose(record.time, [0.02 * i for i in range(8)], rtol=1e-15)
    np.testing.assert_allclose(record["state/u"], [-0.3048 * (10 + i) for i in range(8)], rtol=1e-15)
    np.testing.assert_allclose(record["effector/de1"], [-3 * i * np.pi / 180 for i in range(8)], rtol=1e-15)


def test_a_channel_says_where_it_comes_from(tmp_path):
    record = read(tmp_path, table())
    channel = record.channel("state/u")
    assert (channel.unit, channel.native_rate_hz) == ("m/s", pytest.approx(50.0))
    assert channel.source == "log.csv: column 'u', ft/s, sign -1"
    assert record.provenance["source"]["file"] == "log.csv"
    assert len(record.provenance["source"]["sha256"]) == 64


def test_a_table_without_header_is_read_by_number(tmp_path):
    by_number = ColumnMap(
        time=TimePlace(column=1, unit="s"), channel=(ChannelPlace(name="state/q", column=3, unit="deg/s"),)
    )
    record = read(tmp_path, table(header=None, delimiter="  "), by_number)
    np.testing.assert_allclose(record["state/q"], np.deg2rad([-3 * i for i in range(8)]))
    with pytest.raises(DataError, match="has no header"):
        read(tmp_path, table(header=None))


def test_quotes_byte_order_mark_blank_lines_and_latin_1_headers_do_no_harm(tmp_path):
    text = "\ufeff\n" + table(
        rows=[tuple(f'"{x}"' for x in row) for row in ROWS], header=('"t"', '"u"', '"de"')
    )
    np.testing.assert_allclose(read(tmp_path, text + "\n\n")["effector/de1"][2], np.deg2rad(-6))
    degrees = ColumnMap(time=TIME, channel=(ChannelPlace(name="effector/de1", column="de °", unit="deg"),))
    latin = table(header=("t", "u", "de °")).encode("latin-1")
    assert read(tmp_path, latin, degrees)["effector/de1"][2] == pytest.approx(np.deg2rad(-6))


def test_numbers_are_read_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(3)
    exact = rng.normal(size=200) * 10.0 ** rng.integers(-30, 30, 200)
    rows = [(repr(0.01 * i), repr(float(x)), "0") for i, x in enumerate(exact)]
    column_map = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/u", column="u", unit="m/s"),))
    np.testing.assert_array_equal(read(tmp_path, table(rows), column_map)["state/u"], exact)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"t,u,de\n", "no rows"),
        (b"t,u,de\n0,1,2\n", "at least two samples"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "found byte 0x1a|found byte 0x00"),
        (table()[:-7].encode(), "line 9 has 2 fields, expected 3"),
        (table(ROWS[:4]) + "\n" + table(ROWS[4:], header=None), "line 6 has 0 fields"),
        (table([*ROWS, (1, 2, 3, 4)]), "line 10 has 4 fields"),
        (table(with_cell(3, 1, "abc")), "line 5, column 2: found 'abc', expected a number"),
        (table(with_cell(3, 1, "1_0")), "line 5, column 2: found '1_0'"),
        (table([(t, "1,5", 0) for t, *_ in ROWS], delimiter=";"), "line 2, column 2: found '1,5'.*point"),
        (table([(t, "True", 0) for t, *_ in ROWS]), "line 2, column 2: found 'True'"),
        (table(with_cell(3, 1, "")), r"'state/u' is not finite in 1 of 8 samples, first at t = 0.06 s"),
        (table(with_cell(3, 1, "nan")), "'state/u' is not finite"),
        (table(with_cell(3, 2, "-inf")), "'effector/de1' is not finite"),
        (table(with_cell(3, 1, "1e999")), "'state/u' is not finite"),
        (table(with_cell(3, 0, "nan")), "time is not finite at sample 3"),
        (table([*ROWS[:4], *ROWS[3:]]), "time repeats at sample 4"),
        (table([*ROWS[:4], *ROWS]), "time runs backward at sample 4"),
        (table([*ROWS[:3], *ROWS[5:]]), "time is not uniform.*--resample"),
        (table([(1e6 * t, u, d) for t, u, d in ROWS]), "time advances by 2e.04 s a sample.*correct the unit"),
        (
            table([(1e3 * t, u, d) for t, u, d in ROWS]),
            "time advances by 20 s a sample, expected between 1e-06 and 1 s.*correct",
        ),
        (table(header=("t", "v", "de")), "column 'u' is missing; known names are: de, t, v"),
        (table(header=("t", "U", "de")), "column 'u' is missing; did you mean 'U'"),
        (table(header=("t", "u", "u")), "2 columns are named 'u'.*by number"),
    ],
)
def test_a_fault_is_a_data_error_that_names_the_file_and_the_place(tmp_path, content, said):
    with pytest.raises(DataError, match=said) as caught:
        read(tmp_path, content)
    assert caught.value.where == str(tmp_path / "log.csv")


def test_a_column_beyond_the_table_is_refused(tmp_path):
    beyond = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/u", column=4, unit="m/s"),))
    with pytest.raises(DataError, match="column 4 is missing, the table has 3"):
        read(tmp_path, table(), beyond)


def test_a_variable_is_nothing_a_text_table_has(tmp_path):
    variable = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/u", variable="u", unit="m/s"),))
    with pytest.raises(DataError, match="'u' is a variable"):
        read(tmp_path, table(), variable)


@pytest.mark.parametrize(
    ("channel", "said"),
    [
        (ChannelPlace(name="state/u", column="u"), "channel 'state/u': a unit is missing"),
        (
            ChannelPlace(name="state/u", column="u", unit="deg"),
            "'state/u': found unit 'deg', expected .*'m/s'",
        ),
        (
            ChannelPlace(name="state/u", column="u", unit="fts"),
            "channel 'state/u': unit 'fts' is not understood",
        ),
        (ChannelPlace(name="effector/de1", column="u", unit="K"), "'effector/de1': found unit 'K'"),
        (ChannelPlace(name="effector/de1", column="u"), "channel 'effector/de1': a unit is missing"),
    ],
)
def test_a_wrong_or_missing_unit_names_its_channel_and_file(tmp_path, channel, said):
    with pytest.raises(DataError, match=said) as caught:
        read(tmp_path, table(), ColumnMap(time=TIME, channel=(channel,)))
    assert caught.value.where == str(tmp_path / "log.csv")


def test_effectors_take_the_unit_of_the_vehicle_or_of_their_dimension(tmp_path):
    properties = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0))
    rotor = Effector(name="de1", kind="rotor", limits=(0.0, 900.0))
    vehicle = Vehicle(name="x", mass_properties=properties, effectors=(rotor,))
    rpm = ColumnMap(time=TIME, channel=(ChannelPlace(name="effector/de1", column="u", unit="rpm"),))
    record = read(tmp_path, table(), rpm, vehicle=vehicle)
    assert record.channel("effector/de1").unit == "rad/s"
    assert record["effector/de1"][0] == pytest.approx(10 * 2 * np.pi / 60)
    assert record.vehicle is vehicle
    with pytest.raises(DataError, match="found unit 'deg', expected a unit that converts to 'rad/s'"):
        read(tmp_path, table(), vehicle=vehicle)
    for unit, si in (("deg", "rad"), ("rpm", "rad/s"), ("lbf", "N"), ("%", "1"), ("in", "m")):
        free = ColumnMap(time=TIME, channel=(ChannelPlace(name="command/x", column="u", unit=unit),))
        assert read(tmp_path, table(), free).channel("command/x").unit == si


def test_the_clock_may_count_in_microseconds_of_the_epoch(tmp_path):
    rows = [(f"{1_700_000_000_000_000 + 2500 * i}", 1.0, 2.0) for i in range(400)]
    column_map = ColumnMap(time=TimePlace(column="t", unit="us"), channel=(U,))
    record = read(tmp_path, table(rows), column_map)
    assert record.dt == pytest.approx(0.0025, rel=1e-6)


def test_mass_properties_are_the_means_of_their_columns(tmp_path):
    header = (*HEADER, "m", "I", "x")
    rows = [(*row, 2.0 + 0.1 * i, 3.0, 20.0) for i, row in enumerate(ROWS)]
    mass = [
        MassPlace(name="mass", column="m", unit="slug"),
        MassPlace(name="cg_x", column="x", unit="in", sign=-1),
    ]
    mass += [MassPlace(name=name, column="I", unit="slug ft2") for name in ("Ixx", "Iyy", "Izz")]
    column_map = ColumnMap(time=TIME, channel=(U,), mass_property=tuple(mass))
    found = read(tmp_path, table(rows, header), column_map).mass_properties
    assert found.mass_kg == pytest.approx(2.35 * 14.59390294, rel=1e-9)
    assert found.cg_m == pytest.approx((-0.508, 0.0, 0.0))
    assert found.inertia.yy == pytest.approx(3.0 * 1.3558179483, rel=1e-9)
    assert (
        read(tmp_path, table(rows, header), column_map, cut=(0.0, 0.02)).mass_properties.mass_kg
        < found.mass_kg
    )
    without = ColumnMap(time=TIME, channel=(U,), mass_property=tuple(mass[:3]))
    with pytest.raises(DataError, match=r"mass properties \['Iyy', 'Izz'\] are missing"):
        read(tmp_path, table(rows, header), without)
    with pytest.raises(DataError, match="mass_kg is -"):
        read(tmp_path, table([(*r[:3], -1.0, *r[4:]) for r in rows], header), column_map)
    with pytest.raises(DataError, match="mass property 'mass' is not finite"):
        read(tmp_path, table([(*r[:3], "", *r[4:]) for r in rows], header), column_map)


def test_a_cut_leaves_faults_outside_it_behind(tmp_path):
    rows = [*with_cell(0, 1, "nan"), (5.0, 1, 1), (4.0, 1, 1)]
    record = read(tmp_path, table(rows), cut=(0.04, 0.1))
    np.testing.assert_allclose(record.time, [0.04, 0.06, 0.08, 0.1])
    assert record.provenance["cut_s"] == [0.04, 0.1]
    with pytest.raises(UsageError, match=r"cut 0.04:9 s is not inside the log, which runs 0:0.14 s"):
        read(tmp_path, table(), cut=(0.04, 9.0))


def test_slow_and_blank_channels_are_resampled_with_their_own_native_rate(tmp_path):
    t = np.arange(0, 20.001, 0.02)
    rows = [
        (f"{x:.2f}", f"{np.sin(0.5 * x):.9f}", f"{np.cos(0.3 * x):.9f}" if i % 10 == 0 else "")
        for i, x in enumerate(t)
    ]
    free = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/u", column="u", unit="m/s"), DE))
    record = read(tmp_path, table(rows), free, resample_hz=25.0)
    assert record.dt == pytest.approx(0.04)
    assert record.channel("state/u").native_rate_hz == pytest.approx(50.0)
    assert record.channel("effector/de1").native_rate_hz == pytest.approx(5.0)
    middle = slice(100, -100)
    np.testing.assert_allclose(record["state/u"][middle], np.sin(0.5 * record.time[middle]), atol=1e-5)
    np.testing.assert_allclose(
        record["effector/de1"][middle], np.deg2rad(np.cos(0.3 * record.time[middle])), atol=1e-5
    )
    assert record.provenance["resampled"]["rate_hz"] == 25.0


def test_a_stated_rate_bounds_the_native_rate(tmp_path):
    held = ColumnMap(time=TIME, channel=(ChannelPlace(name="state/u", column="u", unit="m/s", rate_hz=10.0),))
    assert read(tmp_path, table(), held).channel("state/u").native_rate_hz == 10.0


def test_a_missing_file_is_a_data_error(tmp_path):
    with pytest.raises(DataError, match="cannot be read"):
        read_csv(tmp_path / "none.csv", MAP)
