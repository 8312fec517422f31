"""Named channels, checked, as the real equations that a regression solves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.errors import DataError, UsageError


def checked_channels(
    values: ArrayLike, names: Sequence[str] | None, what: str
) -> tuple[NDArray, tuple[str, ...]]:
    """Return channels as a two-dimensional float or complex array, with their names.

    Parameters
    ----------
    values : array_like, shape (n, M)
        Channels on M lines or samples.
    names : sequence of str, length n, or None
        Their names; None numbers them.
    what : str
        What such a channel is called in an error, "regressor" or "response".

    Returns
    -------
    channels : ndarray, shape (n, M), float64 or complex128
        The values.
    names : tuple of str, length n
        The names.

    Raises
    ------
    UsageError
        The shape or the number of names is wrong, or a name comes twice.
    DataError
        A value is not finite; the sentence names the channel.
    """
    channels = np.asarray(values)
    if channels.ndim != 2:
        raise UsageError(f"{what}s must be of shape (channel, line), found {channels.ndim} dimensions")
    channels = channels.astype(np.complex128 if np.iscomplexobj(channels) else np.float64, copy=False)
    names = tuple(f"{what} {i + 1}" for i in range(len(channels))) if names is None else tuple(names)
    if len(names) != len(channels):
        raise UsageError(f"{len(channels)} {what}s came with {len(names)} names")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UsageError(f"{what} '{twice}' is named twice")
    finite = np.isfinite(channels)
    if not finite.all():
        channel = int(np.argmin(finite.all(axis=1)))
        raise DataError(
            f"{what} '{names[channel]}' has {np.count_nonzero(~finite[channel])} of {channels.shape[1]} "
            "values that are not finite",
            remedy="repair or cut the record before it is transformed",
        )
    return channels, names


def real_equations(*tables: NDArray) -> list[NDArray[np.float64]]:
    """Return tables of shape (n, M) as real equations, shape (n, E).

    Where any table is complex, all get their real parts and then their imaginary parts, E = 2 M: a
    complex equation with real unknowns is two real ones. Where all are real they stay, E = M.

    Raises
    ------
    UsageError
        The tables differ in M.
    """
    lengths = [table.shape[1] for table in tables]
    if len(set(lengths)) > 1:
        raise UsageError(f"regressors and responses differ in their number of lines: {lengths}")
    if any(np.iscomplexobj(table) for table in tables):
        return [np.concatenate([np.real(table), np.imag(table)], axis=1) for table in tables]
    return list(tables)


def refuse_zero(equations: NDArray[np.float64], names: Sequence[str]) -> NDArray[np.float64]:
    """Return the length of each column, shape (n,), or name the column that is zero throughout.

    Raises
    ------
    DataError
        A column has no content.
    """
    length = np.sqrt(np.einsum("ne,ne->n", equations, equations))
    if not length.all():
        raise DataError(
            f"regressor '{names[int(np.argmin(length))]}' is zero throughout, so its parameter cannot be "
            "estimated",
            remedy="drop it, or excite it",
        )
    return length
