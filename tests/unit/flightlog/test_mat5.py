"""The level-5 format: against scipy's writer, and against files built byte by byte."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from freqid.core.errors import DataError
from freqid.flightlog.readers.mat5 import MatlabObject, read_mat5

MATRIX = np.arange(6.0).reshape(3, 2)
VARIABLES = {
    "matrix": MATRIX,
    "row": MATRIX[:1],
    "cube": np.arange(24, dtype=np.int16).reshape(2, 3, 4),
    "single": np.float32([1.5, 2.5]),
    "flag": np.array([True, False]),
    "big": np.array([2**40, -1]),
    "z": np.array([1 + 2j, 3.0]),
    "text": "käse Ω",
    "none": "",
    "empty": np.empty((0, 3)),
    "cells": np.array(["a", 2.0, MATRIX], dtype=object),
    "nested": {"x": {"y": 3.0}, "name": "n"},
    "array": np.array([(1.0, "p"), (2.0, "q")], dtype=[("a", object), ("b", object)]),
}


def saved(variables, compressed=False):
    stream = io.BytesIO()
    savemat(stream, variables, do_compression=compressed)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_everything_a_log_may_hold(compressed):
    found = read_mat5(saved(VARIABLES, compressed))
    assert set(found) == set(VARIABLES)
    for name in ("matrix", "row", "cube", "single", "flag", "big", "z"):
        np.testing.assert_array_equal(found[name], np.squeeze(VARIABLES[name]))
    assert (found["text"], found["none"]) == ("käse Ω", "")
    assert found["empty"].size == 0
    assert found["cells"][:1] == ["a"]
    np.testing.assert_array_equal(found["cells"][2], MATRIX)
    assert found["nested"]["name"] == "n"
    assert float(found["nested"]["x"]["y"]) == 3.0
    assert [(float(row["a"]), row["b"]) for row in found["array"]] == [(1.0, "p"), (2.0, "q")]


def by_hand(order, values=b"", kind=9, flags=6, compress=False):
    """A file with one 2 x 1 variable 'ab', written from the format's description."""

    def element(code, data):
        return struct.pack(f"{order}II", code, len(data)) + data + b"\0" * (-len(data) % 8)

    body = element(6, struct.pack(f"{order}II", flags, 0))
    body += element(5, struct.pack(f"{order}ii", 2, 1))
    body += struct.pack(f"{order}I", 2 << 16 | 1) + b"ab\0\0"  # a small element
    body += element(kind, values or struct.pack(f"{order}dd", 1.5, -2.0))
    whole = element(14, body)
    if compress:
        packed = zlib.compress(whole)
        whole = struct.pack(f"{order}II", 15, len(packed)) + packed  # not padded
    mark = b"\x00\x01IM" if order == "<" else b"\x01\x00MI"
    return b"MATLAB 5.0 MAT-file".ljust(124) + mark + whole


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("compress", [False, True])
def test_either_byte_order(order, compress):
    np.testing.assert_array_equal(read_mat5(by_hand(order, compress=compress))["ab"], [1.5, -2.0])
    narrow = by_hand(order, struct.pack(f"{order}hh", -300, 7), kind=3, compress=compress)
    np.testing.assert_array_equal(read_mat5(narrow)["ab"], [-300.0, 7.0])


def test_what_has_no_plain_counterpart_is_empty():
    assert read_mat5(by_hand("<", flags=5)) == {"ab": {}}
    assert read_mat5(by_hand("<", flags=16)) == {}


def opaque(name, class_name):
    """A file with one object, its header as MATLAB writes it: name, class system, class, and numbers."""

    def element(code, data):
        return struct.pack("<II", code, len(data)) + data + b"\0" * (-len(data) % 8)

    body = element(6, struct.pack("<II", 17, 0))
    body += element(1, name) + element(1, b"MCOS") + element(1, class_name)
    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1))
    numbers += element(1, b"") + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    whole = element(14, body + element(14, numbers))
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + whole


def test_an_object_is_known_by_its_class():
    found = read_mat5(opaque(b"ts", b"timeseries"))
    assert found == {"ts": MatlabObject("timeseries")}


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"", "no header"),
        (b"MATLAB 5.0".ljust(128), "no header"),
        (by_hand("<")[:-1], "truncated: an element"),
        (by_hand("<") + b"\0\0\0", "truncated inside a tag"),
        (by_hand("<", compress=True)[:-6], "truncated"),
        (by_hand("<", kind=16), "data of type 16 where numbers are expected"),
        (by_hand("<", kind=99), "data of type 99"),
        (by_hand("<", values=b"12345678"), r"1 values in variable 'ab' of shape \(2, 1\)"),
        (by_hand("<", values=b"123456"), "6 bytes of numbers that take 8 each"),
        (by_hand("<", flags=1), "2 elements in variable 'ab'|element of type 9|1 elements in variable 'ab'"),
        (by_hand("<", flags=2), "without a length|incomplete"),
    ],
)
def test_damage_is_said(raw, said):
    with pytest.raises(DataError, match=said):
        read_mat5(raw)


def test_a_damaged_compressed_variable_fails_its_checksum():
    raw = bytearray(by_hand("<", compress=True))
    raw[-2] ^= 1
    with pytest.raises(DataError, match="is damaged"):
        read_mat5(bytes(raw))


def test_no_damaged_byte_ends_in_anything_but_a_data_error():
    whole = saved({"data": MATRIX, "s": {"a": "txt", "b": np.array(["x", 1.0], dtype=object)}})
    refused = 0
    for place in range(124, len(whole)):
        for byte in (0, 1, 5, 14, 128, 255, whole[place] ^ 1):
            damaged = bytearray(whole)
            damaged[place] = byte
            try:
                read_mat5(bytes(damaged))
            except DataError:
                refused += 1
    assert refused > 1000
