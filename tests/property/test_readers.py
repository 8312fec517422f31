"""Whatever bytes and tables a reader is given: a whole record or an error of ours, and no warning."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import savemat

from freqid.core.errors import DataError, FreqidError, UsageError
from freqid.core.record import FlightRecord, check_time
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, MassPlace, TimePlace, read_column_map
from freqid.flightlog.read import read_log
from freqid.flightlog.readers.csv import read_csv
from freqid.flightlog.readers.matlab import read_matlab
from freqid.flightlog.readers.sidpac import read_sidpac, write_sidpac

many = settings(max_examples=150, deadline=None, derandomize=True)
some = settings(max_examples=60, deadline=None, derandomize=True)

BY_NUMBER = ColumnMap(
    time=TimePlace(column=1, unit="s"),
    channel=(
        ChannelPlace(name="state/q", column=2, unit="deg/s"),
        ChannelPlace(name="state/psi", column=3, unit="deg"),
    ),
    mass_property=tuple(
        MassPlace(name=n, column=i, unit="kg" if n == "mass" else "kg m2")
        for i, n in enumerate(("mass", "Ixx", "Iyy", "Izz"), start=4)
    ),
)
BY_NAME = ColumnMap(
    time=TimePlace(column="t", unit="ms"), channel=(ChannelPlace(name="effector/x", column="a", unit="rpm"),)
)
MATRIX = ColumnMap(
    time=TimePlace(column=1, unit="s"), channel=(ChannelPlace(name="state/q", column=2, unit="deg/s"),)
)
MAGIC = [
    b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM",
    b"\x89HDF\r\n\x1a\n",
    b"\xef\xbb\xbf",
    b"t,a\n0,1\n1,2\n",
    b"",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("readers")


def whole_or_refused(read, *arguments, **options) -> FlightRecord | None:
    """Call a reader; what comes back is a whole record, or None after an error of ours."""
    refusal = None
    try:
        record = read(*arguments, **options)
    except (DataError, UsageError) as error:
        refusal = error
    if refusal is not None:
        assert refusal.where, "the error does not name its file"
        assert "\n" not in refusal.message
        return None
    check_time(record.time)
    assert 0 < record.dt < np.inf
    assert record.channels
    for channel in record.channels.values():
        assert channel.values.shape == record.time.shape
        assert channel.values.dtype == np.float64
        assert np.isfinite(channel.values).all()
        assert 0 < channel.native_rate_hz < np.inf
    return record


noise = st.builds(lambda head, tail: head + tail, st.sampled_from(MAGIC), st.binary(max_size=400))
text = st.text(st.characters(codec="utf-8"), max_size=200).map(str.encode)
tabular = st.text("0123456789.,;\t \n\r\"'eE+-naifxt#_", max_size=300).map(str.encode)


@many
@given(content=st.one_of(noise, text, tabular), rate=st.sampled_from([None, 1.0, 50.0]))
def test_arbitrary_bytes_are_no_table(folder, content, rate):
    path = folder / "x.csv"
    path.write_bytes(content)
    for column_map in (BY_NUMBER, BY_NAME):
        whole_or_refused(read_csv, path, column_map, resample_hz=rate)


@many
@given(content=st.one_of(noise, text))
def test_arbitrary_bytes_are_no_matlab_file(folder, content):
    path = folder / "x.mat"
    path.write_bytes(content)
    assert whole_or_refused(read_matlab, path, MATRIX) is None
    assert whole_or_refused(read_sidpac, path) is None


@many
@given(content=noise, suffix=st.sampled_from([".csv", ".mat", ".ulg", ".bin", ".h5", ".txt", ""]))
def test_arbitrary_bytes_behind_any_suffix(folder, content, suffix):
    path = folder / f"y{suffix}"
    path.write_bytes(content)
    whole_or_refused(read_log, path)
    whole_or_refused(read_log, path, MATRIX, cut=(0.0, 1.0))


@many
@given(
    content=st.one_of(
        noise,
        text,
        st.text("[]=\"'.timechanlu unit#\n0123,{}-:T", max_size=200).map(
            lambda tail: b'[time]\ncolumn = 1\nunit = "s"\n' + tail.encode()
        ),
    )
)
def test_arbitrary_bytes_are_no_column_map(folder, content):
    path = folder / "x.toml"
    path.write_bytes(content)
    with pytest.raises(FreqidError) as caught:
        read_column_map(path)
    assert isinstance(caught.value, (DataError, UsageError))
    assert caught.value.where == str(path)


wild = st.one_of(
    st.floats(width=64),
    st.sampled_from([0.0, 1.0, -1.0, np.nan, np.inf, 1e308, 5e-324, 1e-300]),
)
rates = st.sampled_from([None, 0.001, 1.0, 7.3, 50.0, 1e6, -1.0, float("nan")])


@st.composite
def tables(draw, columns=7):
    """Tables with a clock that is wild, or nearly good, and cells that are wild, or mostly good."""
    rows = draw(st.integers(1, 30))
    data = draw(
        hnp.arrays(np.float64, (rows, columns), elements=draw(st.sampled_from([wild, st.floats(-10, 10)])))
    )
    if draw(st.booleans()):
        step = draw(st.sampled_from([0.02, 1e-9, 3e3, 1e300, 5e-324]))
        jitter = draw(
            hnp.arrays(np.float64, rows, elements=st.sampled_from([0.0, 0.0, 0.0, 0.1, 1.0, -0.9999999]))
        )
        data[:, 0] = draw(st.sampled_from([0.0, 1.7e9])) + step * (np.arange(rows) + jitter)
    if draw(st.booleans()):
        data[:, 3:] = np.abs(data[:, 3:])
    return data


@many
@given(data=tables(), rate=rates, header=st.booleans(), cut=st.sampled_from([None, (0.0, 0.2), (-1.0, 1e9)]))
def test_arbitrary_numbers_in_a_table(folder, data, rate, header, cut):
    path = folder / "z.csv"
    lines = [",".join("" if np.isnan(x) else repr(float(x)) for x in row) for row in data]
    path.write_text("\n".join(["t,a,b,c,d,e,f"] * header + lines) + "\n")
    whole_or_refused(read_csv, path, BY_NUMBER, resample_hz=rate, cut=cut)
    whole_or_refused(read_csv, path, BY_NAME, resample_hz=rate)


@many
@given(
    cells=st.lists(
        st.lists(
            st.sampled_from(["1", "2.5", "", "x", "1e999", "nan", "0x1", "1,5", '"', "True", "-"]),
            min_size=3,
            max_size=3,
        ),
        min_size=2,
        max_size=12,
    ),
    delimiter=st.sampled_from([";", "\t", " "]),
)
def test_arbitrary_cells_in_a_table(folder, cells, delimiter):
    path = folder / "c.csv"
    path.write_text(
        "t a b\n".replace(" ", delimiter)
        + "".join(delimiter.join([str(i), *row[1:]]) + "\n" for i, row in enumerate(cells))
    )
    seconds = ColumnMap(time=TimePlace(column="t", unit="s"), channel=BY_NAME.channel)
    record = whole_or_refused(read_csv, path, seconds)
    if record is not None:
        expected = [float(row[1]) * 2 * np.pi / 60 for row in cells]
        np.testing.assert_allclose(record["effector/x"], expected, rtol=1e-12)


@some
@given(data=tables(columns=90), rate=rates)
def test_arbitrary_numbers_in_the_sidpac_layout(folder, data, rate):
    path = folder / "s.mat"
    savemat(path, {"fdata": data})
    record = whole_or_refused(read_sidpac, path, resample_hz=rate)
    if record is not None:
        write_sidpac(record, folder / "back.mat")
        whole_or_refused(read_sidpac, folder / "back.mat")


@some
@given(
    value=st.one_of(
        hnp.arrays(st.one_of(hnp.scalar_dtypes()), hnp.array_shapes(max_dims=4, max_side=4)),
        st.text(max_size=5),
        st.dictionaries(st.from_regex("[a-z]{1,5}", fullmatch=True), st.integers(-5, 5), max_size=3),
    )
)
def test_arbitrary_variables_in_a_matlab_file(folder, value):
    path = folder / "v.mat"
    try:
        savemat(path, {"data": value})
    except Exception:
        return  # what scipy cannot write no file holds
    whole_or_refused(read_matlab, path, MATRIX)
    whole_or_refused(read_log, path)


T = 0.1 * np.arange(50)
GOOD = np.column_stack([T, np.sin(T)])


def good_csv(path):
    path.write_text("t,q\n" + "".join(f"{t!r},{q!r}\n" for t, q in GOOD.tolist()))


def good_mat(path):
    savemat(path, {"data": GOOD}, do_compression=False)


def good_mat_compressed(path):
    savemat(path, {"data": GOOD}, do_compression=True)


def good_mat73(path):
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("data", data=GOOD.T)


@pytest.mark.parametrize("make", [good_mat, good_mat_compressed, good_mat73])
@some
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_truncated_matlab_file_is_a_data_error(folder, make, share):
    path = folder / f"{make.__name__}.mat"
    make(path)
    whole = path.read_bytes()
    np.testing.assert_allclose(read_matlab(path, MATRIX)["state/q"], np.deg2rad(GOOD[:, 1]))
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError) as caught:
        read_matlab(path, MATRIX)
    assert caught.value.where == str(path)


@many
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_truncated_table_gives_an_error_or_the_samples_before_the_cut(folder, share):
    """A text table has no end mark: cut after a whole line it is a shorter table, and no reader can tell."""
    path = folder / "t.csv"
    good_csv(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    record = whole_or_refused(read_csv, path, MATRIX)
    if record is not None:
        kept = record.time.size - (not path.read_bytes().endswith(b"\n"))
        np.testing.assert_allclose(record["state/q"][:kept], np.deg2rad(GOOD[:kept, 1]))


@pytest.mark.parametrize("make", [good_csv, good_mat, good_mat_compressed])
@many
@given(share=st.floats(0, 1, exclude_max=True), byte=st.integers(0, 255))
def test_one_damaged_byte_is_survived(folder, make, share, byte):
    path = folder / f"{make.__name__}.{'csv' if make is good_csv else 'mat'}"
    make(path)
    damaged = bytearray(path.read_bytes())
    damaged[int(share * len(damaged))] = byte
    path.write_bytes(damaged)
    whole_or_refused(read_csv if make is good_csv else read_matlab, path, MATRIX)
