"""One input's frequency response from a sweep or doublets: overlapped windows of several lengths.

Short windows give many averages, long ones reach low frequencies; at each frequency they are weighted by
their random errors.

References
----------
M. B. Tischler, R. K. Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., AIAA, 2012, ch. 7
(windowed spectra, random error) and ch. 10 (composite windows; here their weighted mean).
J. S. Bendat, A. G. Piersol, *Random Data*, 4th ed., Wiley, 2010, sec. 9.2 (errors of frequency responses).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.identify.spectra.fourier import FourierPlan

OVERLAP = 0.8
WINDOWS = (0.5, 0.33, 0.2, 0.12)
"""Lengths of the windows, as shares of the shortest record."""

SHORTEST = 2.0  # periods of a frequency that a window must hold to say anything about it


def window_response(
    input_: Sequence[ArrayLike],
    output: Sequence[ArrayLike],
    dt: float,
    frequencies_hz: ArrayLike,
    *,
    injected: Sequence[ArrayLike] | None = None,
    windows_s: Sequence[float] | None = None,
    names: tuple[str, str] = ("input", "output"),
    units: tuple[str, str] = ("1", "1"),
) -> FrequencyResponse:
    """Estimate the response of one output to one input.

    Parameters
    ----------
    input_, output : sequence of array_like, shape (sample,)
        Of each record.
    dt : float
        s.
    frequencies_hz : array_like, shape (M,)
        Hz, ascending; those that no window reaches are nan.
    injected : sequence of array_like, shape (sample,), optional
        Signal that was injected; with it as instrument feedback does not bias the estimate. Without it the
        response is that of least squares on the input, right where nothing is fed back.
    windows_s : sequence of float, optional
        s; `WINDOWS` of the shortest record where absent.
    names, units : tuple of 2 str
        Of input and output.

    Returns
    -------
    FrequencyResponse
        With coherence between output and input, or injected signal.

    Raises
    ------
    DataError
        Where no window reaches any of the frequencies.

    Notes
    -----
    With window i's random error ``e_i = sqrt(1 - c) / sqrt(2 n c)``, c the coherence and n the windows that
    do not overlap, spectra are averaged with weights ``(e_i / e_min)^-4``.
    """
    f = np.asarray(frequencies_hz, dtype=float)
    u, y = ([np.asarray(x, dtype=float) for x in part] for part in (input_, output))
    r = u if injected is None else [np.asarray(x, dtype=float) for x in injected]
    least = dt * min(x.size - 1 for x in u)
    lengths = windows_s or [share * least for share in WINDOWS]
    spectra, error, count = [], [], []
    for length in lengths:
        samples = round(length / dt) + 1
        reached = f * length >= SHORTEST
        if samples < 8 or not reached.any():
            continue
        found, windows = _spectra(r, u, y, dt, samples, f[reached])
        if windows < 2:
            continue
        whole = np.full((6, f.size), np.nan, dtype=complex)
        whole[:, reached] = found
        spectra.append(whole)
        count.append(sum(x.size for x in u) / samples)
        error.append(_random_error(whole, count[-1]))
    if not spectra:
        raise DataError(
            f"no window of {', '.join(f'{x:.3g}' for x in lengths)} s holds {SHORTEST:g} periods of "
            f"{f[-1]:g} Hz and fits twice into a record of {least:.4g} s",
            remedy="raise the frequencies or use longer records",
        )
    error, spectra = np.array(error), np.array(spectra)
    error = np.where(np.isfinite(error), np.maximum(error, 1e-9), np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(np.isfinite(error), (error / error.min(axis=0)) ** -4.0, 0.0)
        weight = weight / weight.sum(axis=0)
        mean = np.nansum(weight[:, None] * np.nan_to_num(spectra), axis=0)
        mean[:, ~np.isfinite(weight).all(axis=0)] = np.nan
        rr, ru, ry, _, yy, _ = mean
        coherence = np.clip(np.abs(ry) ** 2 / (rr.real * yy.real), 0.0, 1.0)
        averages = np.sum(np.nan_to_num(weight) * np.array(count)[:, None], axis=0)
        value = ry / ru
        std = np.abs(value) * _random_error(mean, averages)
    shape = (1, 1, f.size)
    return FrequencyResponse(
        inputs=names[:1],
        outputs=names[1:],
        input_units=units[:1],
        output_units=units[1:],
        frequencies_hz=f,
        value=value.reshape(shape),
        std_error=std.reshape(shape),
        degrees_of_freedom=np.maximum(averages - 1, 1.0)[None],
        coherence=coherence.reshape(shape),
        partial_coherence=coherence.reshape(shape),
        misfit=np.full((1, f.size), np.nan),
        method="windows",
        remarks=()
        if injected is not None
        else ("Without the injected signal feedback biases this response.",),
    )


def _spectra(
    r: list[Array], u: list[Array], y: list[Array], dt: float, samples: int, f: Array
) -> tuple[NDArray[np.complex128], int]:
    """Return rr, ru, ry, uu, yy and uy of one window length, shape (6, M), and the number of windows."""
    plan = FourierPlan(samples, dt, f)
    taper = np.hanning(samples)
    step = max(round((1 - OVERLAP) * (samples - 1)), 1)
    total, windows = np.zeros((6, f.size), dtype=complex), 0
    for one in zip(r, u, y, strict=True):
        signals = np.array(one)
        signals = signals - signals.mean(axis=1, keepdims=True)
        for start in range(0, signals.shape[1] - samples + 1, step):
            R, U, Y = cast(NDArray[np.complex128], plan(signals[:, start : start + samples] * taper))
            R_ = R.conj()
            total += [R_ * R, R_ * U, R_ * Y, U.conj() * U, Y.conj() * Y, U.conj() * Y]
            windows += 1
    return np.asarray(total / max(windows, 1), dtype=np.complex128), windows


def _random_error(spectra: NDArray[np.complex128], averages: Array | float) -> Array:
    """Return the normalised random error of S_ry / S_ru, shape (M,): of the noise ``v = y - G u``."""
    rr, ru, ry, uu, yy, uy = spectra
    with np.errstate(invalid="ignore", divide="ignore"):
        G = ry / ru
        noise = np.maximum((yy - 2 * (G.conj() * uy).real + np.abs(G) ** 2 * uu).real, 0.0)
        return np.sqrt(noise * rr.real / (2 * averages)) / np.abs(ry)
