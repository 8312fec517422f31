"""Several inputs' responses at one frequency from the lines near it, with injected signals as instruments.

Each harmonic of orthogonal multisines excites one effector, so that no line by itself tells what each input
does. Responses are smooth, though: near a frequency they are polynomials, and lines of different injected
signals tell their coefficients together (docs/theory/frequency-response.md).

References
----------
R. Pintelon, J. Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., Wiley, 2012,
ch. 7 (local polynomial method, transients as smooth terms) and sec. 2.6 (closed loop: the reference as
instrument).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError

LEAST_FREEDOM = 4
"""Complex degrees of freedom that a window leaves for its noise at least."""

SINGULAR = 1e-7  # of the largest: combinations of inputs that the signals move less are not told apart


@dataclass(frozen=True, eq=False)
class ResponseLines:
    """Transforms of S records on K lines altogether, in any order.

    Attributes
    ----------
    hz : ndarray, shape (K,)
    record : ndarray of int, shape (K,)
        Which record a line is of.
    excited : ndarray of bool, shape (m, K)
        Which injected signals have power there; where none has, it is a noise line.
    r, u, y : ndarray of complex, shape (m, K), (n, K), (o, K)
        Injected signals, inputs, outputs; n is at most m. Noise has one power in all records, so the
        transforms are over the square root of the duration.
    """

    hz: Array
    record: NDArray[np.int64]
    excited: NDArray[np.bool_]
    r: Complex
    u: Complex
    y: Complex


@dataclass(frozen=True, eq=False)
class LocalResponse:
    """Responses at one frequency; shapes as in `FrequencyResponse` without its last axis.

    Attributes
    ----------
    value : ndarray of complex, shape (o, n)
    variance : ndarray, shape (o, n)
        Mean squared magnitude of the error.
    degrees_of_freedom : float
    coherence, partial_coherence : ndarray, shape (o, m) and (o, n)
    misfit : ndarray, shape (o,)
    density : float
        Independent estimates per Hz: those of neighbouring frequencies share lines.
    strength : ndarray, shape (n,), optional
        First-stage F of each input, the others' parts of it left out: below `LEAST_STRENGTH` of two-stage
        least squares its responses lean towards those without instruments, by more than their errors say.
    """

    value: Complex
    variance: Array
    degrees_of_freedom: float
    coherence: Array
    partial_coherence: Array
    misfit: Array
    density: float
    strength: Array | None = None


def local_response(
    lines: ResponseLines, at_hz: float, order: int, count: int, poles: int = 0
) -> LocalResponse:
    """Solve for the responses at one frequency.

    Parameters
    ----------
    lines : Lines
    at_hz : float
    order : int
        Degree of the polynomials in frequency.
    count : int
        Lines of each injected signal, nearest first, in whatever records; more where these leave fewer than
        `LEAST_FREEDOM`.
    poles : int
        Degree of a denominator that all inputs share, in frequency too: two follow a resonance that is
        narrow beside the spacing of one signal's lines. 0 for polynomials alone.

    Returns
    -------
    LocalResponse

    Raises
    ------
    DataError
        Where there are not lines enough, or the injected signals do not move the inputs apart.

    Notes
    -----
    ``Y = G U + T + V``; instruments of the polynomial terms of ``G U`` are those of R, of T (transients of
    each record) T itself. As many instruments as columns, or more: two-stage least squares. With a
    denominator ``D = 1 + d_1 x + ...`` it is ``D Y = G U + T + V``, output by output: columns ``Y x^p``, and
    one more power of R as instruments (local rational method). D is 1 at the frequency itself.
    """
    chosen, x = _window(lines, at_hz, order + (poles > 0), count)
    r, u, y = lines.r[:, chosen], lines.u[:, chosen], lines.y[:, chosen]
    powers = x ** np.arange(order + 1)[:, None]
    here = lines.record[chosen] == np.unique(lines.record[chosen])[:, None]
    transient = terms(here.astype(complex), powers)
    instruments = np.concatenate([terms(scaled(r)[0], powers), transient])
    columns, scale = scaled(u)
    columns = np.concatenate([terms(columns, powers), transient])
    n, stride = len(u), order + 1
    first = np.arange(n) * stride
    if poles:
        more = np.concatenate([instruments, scaled(r)[0] * x ** (order + 1)])
        raised = x ** np.arange(1, poles + 1)[:, None]
        solved = [
            _solved(one, np.concatenate([columns, terms(scaled(one)[0], raised)]), more, at_hz)
            for one in y[:, None]
        ]
    else:
        solved = [_solved(y, columns, instruments, at_hz)]
    value = np.concatenate([one.solution[:, first] for one in solved]) / scale
    noise = np.concatenate([one.noise for one in solved])
    gain = np.concatenate(
        [
            np.tile(np.sum(np.abs(one.dual[:, first]) ** 2, axis=0) / scale**2, (len(one.solution), 1))
            for one in solved
        ]
    )
    excited = np.asarray(lines.excited[:, chosen].any(axis=0))
    misfit = np.concatenate([_misfit(one.residual, one.columns, one.dual, excited) for one in solved])

    reduced = np.asarray(np.linalg.pinv(instruments), dtype=np.complex128)
    coherence, partial = coherences(lines, chosen, instruments, reduced, stride, value, noise)
    freedom = min(one.freedom for one in solved)
    density = (order + 1) / np.ptp(lines.hz[chosen])
    strength = np.min([one.strength[first] for one in solved], axis=0)
    return LocalResponse(value, noise[:, None] * gain, freedom, coherence, partial, misfit, density, strength)


def coherences(
    lines: ResponseLines,
    chosen: NDArray[np.int64],
    instruments: Complex,
    reduced: Complex,
    stride: int,
    value: Complex,
    noise: Array,
) -> tuple[Array, Array]:
    """Return coherence with the injected signals and partial coherence with the inputs.

    Parameters
    ----------
    lines : ResponseLines
    chosen : ndarray of int, shape (K,)
        Lines of the window.
    instruments : ndarray of complex, shape (term, K)
        Scaled injected signals times powers, `stride` terms for each signal, then any others.
    reduced : ndarray of complex, shape (K, term)
        Their pseudo-inverse.
    stride : int
    value : ndarray of complex, shape (o, n)
        Responses.
    noise : ndarray, shape (o,)
        Power per line.
    """
    r, u, y = lines.r[:, chosen], lines.u[:, chosen], lines.y[:, chosen]
    both = np.concatenate([y, u])
    _, scatter, _ = _remainder(both, instruments, reduced)
    size = scaled(r)[1]
    own = lines.excited[:, chosen]
    driving = (both @ reduced[:, np.arange(len(r)) * stride]) / size
    power = np.array(
        [np.mean(np.abs(row[mine]) ** 2) if mine.any() else 0.0 for row, mine in zip(r, own, strict=True)]
    )
    signal = np.abs(driving[: len(y)]) ** 2 * power
    share = own.sum(axis=1) / max(own.any(axis=0).sum(), 1)
    spectrum = (driving[len(y) :] * (power * share)) @ driving[len(y) :].conj().T
    conditioned = 1 / np.real(np.diag(np.linalg.pinv(spectrum, rcond=1e-14, hermitian=True)))
    partial = _share(np.abs(value) ** 2 * conditioned, noise[:, None])
    return _share(signal, scatter[: len(y), None]), partial


@dataclass(frozen=True, eq=False)
class _Solution:
    """A solution, shape (row, column), with what its errors are worked out from; strength by column."""

    solution: Complex
    dual: Complex
    strength: Array
    columns: Complex
    residual: Complex
    noise: Array
    freedom: float


def _solved(y: Complex, columns: Complex, instruments: Complex, at_hz: float) -> _Solution:
    """Return two-stage least squares of rows on columns."""
    basis = np.linalg.qr(instruments.conj().T)[0]
    explained = (columns @ basis) @ basis.conj().T
    left, singular, right = np.linalg.svd(explained, full_matrices=False)
    if singular[-1] < SINGULAR * singular[0]:
        raise DataError(
            f"the injected signals do not move the inputs apart near {at_hz:.4g} Hz",
            remedy="leave out inputs that follow others, or excite each by lines of its own",
        )
    dual = np.asarray((right.conj().T / singular) @ left.conj().T, dtype=np.complex128)  # (line, column)
    noise = np.sum(np.abs(columns - explained) ** 2, axis=1) / (columns.shape[1] - len(instruments))
    with np.errstate(divide="ignore"):  # terms that are their own instruments
        strength = 1 / (np.sum(np.abs(dual) ** 2, axis=0) * noise)
    return _Solution(y @ dual, dual, strength, columns, *_remainder(y, columns, dual))


def _window(lines: ResponseLines, at_hz: float, order: int, count: int) -> tuple[NDArray[np.int64], Array]:
    """Return the lines near a frequency, and their distance, at most one in size."""
    key = np.round(lines.hz, 9)
    mine = []  # frequencies of each signal, nearest first; records may share them out differently
    for row in lines.excited:
        own = np.unique(key[row])
        mine.append(own[np.argsort(np.abs(own - at_hz), kind="stable")])
    dark = ~lines.excited.any(axis=0)
    most = max(len(own) for own in mine)
    for each in range(max(count, order + 1), most + 1):
        wanted = np.unique(np.concatenate([own[:each] for own in mine]))
        within = (key >= wanted[0]) & (key <= wanted[-1])
        chosen = np.flatnonzero(within & (dark | np.isin(key, wanted)))
        unknown = (order + 1) * (len(lines.u) + np.unique(lines.record[chosen]).size)
        if chosen.size >= unknown + LEAST_FREEDOM:
            reach = np.max(np.abs(lines.hz[chosen] - at_hz))
            return chosen, (lines.hz[chosen] - at_hz) / (reach or 1.0)
    raise DataError(
        f"{lines.hz.size} lines of {len(lines.r)} injected signals do not determine polynomials of degree "
        f"{order} of {len(lines.u)} inputs and of transients",
        remedy="lower the order, fly two periods, or give each signal more harmonics",
    )


def terms(rows: Complex, powers: Array) -> Complex:
    """Return rows times every power, shape (row x power, line), the powers of one row together."""
    return (rows[:, None] * powers).reshape(-1, powers.shape[1])


def scaled(rows: Complex) -> tuple[Complex, Array]:
    """Return rows of mean square one, and what they were divided by; a row of zeros stays."""
    size = np.sqrt(np.mean(np.abs(rows) ** 2, axis=1))
    size = np.where(size > 0, size, 1.0)
    return rows / size[:, None], size


def _remainder(y: Complex, columns: Complex, dual: Complex) -> tuple[Complex, Array, float]:
    """Return residuals, their noise power per line, shape (row,), and its degrees of freedom.

    The projection is oblique: noise that is white has ``|I - D X|^2`` times its power in the residual, and
    the degrees of freedom follow Satterthwaite.
    """
    residual = y - (y @ dual) @ columns
    keep = np.eye(y.shape[1]) - dual @ columns
    total = float(np.sum(np.abs(keep) ** 2))
    square = keep @ keep.conj().T
    freedom = total**2 / float(np.sum(np.abs(square) ** 2))
    return residual, np.sum(np.abs(residual) ** 2, axis=1) / total, freedom


def _misfit(residual: Complex, columns: Complex, dual: Complex, excited: NDArray[np.bool_]) -> Array:
    """Return the residual's power on excited lines over that on noise lines, shape (row,)."""
    if excited.all():
        return np.full(len(residual), np.nan)
    expected = np.sum(np.abs(np.eye(residual.shape[1]) - dual @ columns) ** 2, axis=0)
    power = np.abs(residual) ** 2
    mine, other = (power[:, k].sum(axis=1) / expected[k].sum() for k in (excited, ~excited))
    with np.errstate(divide="ignore", invalid="ignore"):
        return mine / other


def _share(signal: Array, noise: Array) -> Array:
    total = signal + noise
    return np.divide(signal, total, out=np.zeros_like(total), where=total > 0)
