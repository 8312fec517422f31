"""TOML files, and the tables in them, as validated structs; an unknown key is an error with its path."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.vehicle import Strict

MOST_BYTES = 1_000_000
"""A scenario of 200 effectors and 1000 conditions has 0.2 MB; the parser reads 1 MB in about 2 s."""
MOST = 1e30
"""Largest number in a TOML file."""
_DEEP_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]+[ \t]*\.[ \t]*){32}""")  # its time grows with their square

T = TypeVar("T")
S = TypeVar("S", bound=Strict)


def read_toml(
    path: Path, kind: type[T], prepare: Callable[[dict[str, Any]], dict[str, Any]] | None = None
) -> tuple[T, str]:
    """Read and validate a TOML file.

    Parameters
    ----------
    path : Path
    kind : type
        A struct that has the file's keys.
    prepare : callable, optional
        Given the file's table, returns the one to convert.

    Returns
    -------
    content : kind
    sha256 : str
        Of the file's bytes; results carry it so that they can be traced.

    Raises
    ------
    DataError
        Where the file cannot be read or is no TOML.
    UsageError
        For an unknown key, a wrong type or values that do not fit together, with the key's path.
    """
    table, sha256 = parse_toml(path)
    _check_numbers(table, str(path))
    return convert(prepare(table) if prepare else table, kind, str(path)), sha256


def parse_toml(path: Path) -> tuple[dict[str, Any], str]:
    """Read a TOML file as plain tables, with the hash of its bytes.

    Raises
    ------
    DataError
        Where the file cannot be read, is no TOML, or is so large or nested that the parser would not end.
    """
    where = str(path)
    try:
        with open(path, "rb") as file:
            raw = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", where=where, remedy="check the path") from None
    if len(raw) > MOST_BYTES:
        raise DataError(
            f"is larger than {MOST_BYTES / 1e6:g} MB, which no TOML file of freqid needs",
            where=where,
            remedy="keep tables and flights in files of their own",
        )
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise DataError(f"line {line} is no UTF-8 text", where=where, remedy="save it as UTF-8") from None
    if deep := _DEEP_KEY.search(text):
        line = text[: deep.start()].count("\n") + 1
        raise DataError(f"line {line} has a key of more than 32 parts", where=where, remedy="correct the key")
    try:
        return tomllib.loads(text), hashlib.sha256(raw).hexdigest()
    except (ValueError, RecursionError) as error:
        said = " ".join(str(error).split())
        raise DataError(f"is no valid TOML ({said})", where=where, remedy="mend it") from None


def _check_numbers(table: Any, where: str) -> None:
    """Refuse numbers that no quantity of an aircraft has and that would overflow where they are used."""
    stack: list[tuple[str, Any]] = [("", table)]
    while stack:
        key, value = stack.pop()
        if isinstance(value, dict):
            stack += [(f"{key}.{name}" if key else name, held) for name, held in value.items()]
        elif isinstance(value, list):
            stack += [(f"{key}[{i}]", held) for i, held in enumerate(value)]
        elif isinstance(value, int | float) and not abs(value) <= MOST:
            raise UsageError(
                f"at {key}: found {value:.6g}, expected a finite number of at most {MOST:g}",
                where=where,
                remedy="correct the key",
            )


def convert(table: Any, kind: type[T], where: str) -> T:
    """Convert plain data to a validated struct; an unknown key is an error with its path."""
    try:
        return msgspec.convert(table, kind, strict=True)
    except msgspec.ValidationError as error:
        raise _explained(str(error), kind, where) from None


def overridden(section: S, **changes: Any) -> S:
    """Return a section with some values replaced, those that are not None, and validated again.

    Raises
    ------
    UsageError
        Where the new values do not fit.
    """
    table = msgspec.to_builtins(section) | {k: v for k, v in changes.items() if v is not None}
    return convert(table, type(section), "command line")


def _explained(message: str, kind: type, where: str) -> UsageError:
    """Turn msgspec's sentence into ours, with the nearest known key where a key is unknown."""
    text, _, path = message.partition(" - at `")
    key_path = path.rstrip("`").removeprefix("$").lstrip(".") or "the top level"
    unknown = re.search(r"unknown field `(.+)`", text)
    if unknown:
        return UsageError(
            f"at {key_path}: key '{unknown[1]}' is unknown",
            where=where,
            remedy=nearest(unknown[1], _known_keys(kind, key_path)),
        )
    return UsageError(f"at {key_path}: {text[:1].lower()}{text[1:]}", where=where, remedy="correct the key")


def _known_keys(kind: type, key_path: str) -> list[str]:
    """Return the keys that are allowed at a path of a struct type."""
    names = [] if key_path == "the top level" else re.sub(r"\[[^\]]*\]", "", key_path).split(".")
    structs = _structs_in(kind)
    for name in filter(None, names):
        structs = [
            nested
            for struct in structs
            for field in msgspec.structs.fields(struct)
            if field.name == name
            for nested in _structs_in(field.type)
        ]
    return [field.name for struct in structs for field in msgspec.structs.fields(struct)]


def _structs_in(hint: Any) -> list[type]:
    """Return the struct types inside a type hint such as ``tuple[Effector, ...]``."""
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return [hint]
    return [found for inner in getattr(hint, "__args__", ()) for found in _structs_in(inner)]
