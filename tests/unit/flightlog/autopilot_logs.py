"""Logs in the autopilots' formats: ULog by the published format and pyulog, DataFlash by pymavlink."""

from __future__ import annotations

import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyulog
from pymavlink.DFReader import DFFormat, DFReader_binary

_ULOG_TYPES = {"f4": "float", "f8": "double", "u8": "uint64_t", "u1": "uint8_t", "i4": "int32_t"}


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog_bytes(topics, info=(), parameters=()):
    """A ULog file: ``topics`` is a list of (name, instance, time in s, {field: values}), as published."""
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += message("B", bytes(40))
    for key, value in info:
        text = f"char[{len(value)}] {key}".encode()
        out += message("I", struct.pack("<B", len(text)) + text + value.encode())
    for key, value in parameters:
        text = f"float {key}".encode()
        out += message("P", struct.pack("<B", len(text)) + text + struct.pack("<f", value))
    known = set()
    for name, _, _, fields in topics:
        if name not in known:
            known.add(name)
            rows = [f"{_ULOG_TYPES[np.asarray(x).dtype.str[1:]]} {field};" for field, x in fields.items()]
            out += message("F", (f"{name}:uint64_t timestamp;" + "".join(rows)).encode())
    body = []
    for number, (name, instance, time, fields) in enumerate(topics):
        out += message("A", struct.pack("<BH", instance, number) + name.encode())
        kinds = [
            ("timestamp", "<u8"),
            *((f, np.asarray(x).dtype.newbyteorder("<")) for f, x in fields.items()),
        ]
        table = np.empty(len(time), dtype=kinds)
        table["timestamp"] = np.rint(1e6 * np.asarray(time))
        for field, x in fields.items():
            table[field] = x
        head = struct.pack("<HBH", table.dtype.itemsize + 2, ord("D"), number)
        body += [(int(row["timestamp"]), head + row.tobytes()) for row in table]
    return out + b"".join(row for _, row in sorted(body, key=lambda pair: pair[0]))


def write_ulog(path: Path, topics, **about) -> None:
    """Write a log with pyulog's own writer, from one that it has read."""
    raw = path.with_suffix(".raw")
    raw.write_bytes(ulog_bytes(topics, **about))
    pyulog.ULog(str(raw)).write_ulog(str(path))


def dataflash_bytes(messages):
    """A DataFlash log: ``messages`` is a list of (name, format, columns, rows); rows begin with TimeUS."""
    fmt_fmt = DFFormat(0x80, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")
    writer = SimpleNamespace(formats={0x80: fmt_fmt})
    formats = [fmt_fmt]
    for number, (name, letters, columns, _) in enumerate(messages, start=1):
        made = DFFormat(number, name, 0, letters, columns)
        made.type = number
        formats.append(made)
    out = b"".join(DFReader_binary.make_format_msgbuf(writer, fmt) for fmt in formats)
    body = []
    for fmt, (_, _, _, rows) in zip(formats[1:], messages, strict=True):
        body += [(row[0], DFReader_binary.make_msgbuf(writer, fmt, [_plain(x) for x in row])) for row in rows]
    return out + b"".join(row for _, row in sorted(body, key=lambda pair: pair[0]))


def _plain(value):
    return value.encode() if isinstance(value, str) else value
