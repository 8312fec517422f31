"""How alike a simulation and a flight are, as the field has long said it: J, MUAD bounds, Theil, RMSE."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.errors import UsageError

POINTS = 20
"""Frequencies, even on a logarithmic axis, that J is taken on."""

PHASE_WEIGHT = 0.01745
"""Squared dB that a squared degree is worth: 1 dB counts like 7.57 deg."""

ACCEPTABLE, NEARLY_ALIKE = 100.0, 50.0
"""J up to which a model is acceptable for flight dynamics, and below which it is hard to tell from flight."""

# Gain envelopes of unnoticeable added dynamics, numerator and denominator in falling powers of s, and
# those of phase with a time in exp(s t) beside them.
_UPPER_GAIN = (3.16, 31.61, 22.79), (1.0, 27.14, 1.84)
_LOWER_GAIN = (0.0955, 9.92, 2.15), (1.0, 11.60, 4.95)
_UPPER_PHASE = (68.89, 1100.12, -275.22), (1.0, 39.94, 9.99), 0.0059
_LOWER_PHASE = (475.32, 184100.0, 29456.1), (1.0, 11.66, 0.0389), -0.0072

MUAD_BAND = (0.1, 30.0)
"""Frequencies at which envelopes are judged, rad/s; they are from pilots in the loop."""


@dataclass(frozen=True, eq=False)
class Muad:
    """A mismatch beside the bounds of maximum unnoticeable added dynamics.

    Attributes
    ----------
    frequencies_hz : ndarray, shape (M,)
        Those inside `MUAD_BAND`.
    gain_db, phase_deg : ndarray, shape (M,)
        Of flight over simulation, or of either over the other.
    gain_bounds_db, phase_bounds_deg : ndarray, shape (2, M)
        Lower and upper.
    """

    frequencies_hz: Array
    gain_db: Array
    phase_deg: Array
    gain_bounds_db: Array
    phase_bounds_deg: Array

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Where both gain and phase are inside their bounds, shape (M,)."""
        return (
            (self.gain_db >= self.gain_bounds_db[0])
            & (self.gain_db <= self.gain_bounds_db[1])
            & (self.phase_deg >= self.phase_bounds_deg[0])
            & (self.phase_deg <= self.phase_bounds_deg[1])
        )

    @property
    def unnoticed(self) -> bool:
        """Whether the mismatch stays inside everywhere."""
        return bool(self.inside.all())


@dataclass(frozen=True)
class Theil:
    """Theil's inequality coefficient, and the shares of the mean squared error that it is made of.

    Attributes
    ----------
    coefficient : float
        0 for a perfect prediction, 1 for the worst; up to about 0.25 to 0.3 is accepted.
    bias, variance, covariance : float
        Shares that add up to one: of a mean that is off, of a size that is off, of the rest. nan where there
        is no error.
    """

    coefficient: float
    bias: float
    variance: float
    covariance: float


def frequency_cost(
    frequencies_hz: ArrayLike,
    flight: ArrayLike,
    simulation: ArrayLike,
    coherence: ArrayLike | None = None,
    *,
    points: int | None = POINTS,
) -> float:
    """Return the cost J between two frequency responses.

    Parameters
    ----------
    frequencies_hz : array_like, shape (M,)
        Increasing.
    flight, simulation : array_like of complex, shape (M,)
        nan where not known, left out.
    coherence : array_like, shape (M,), optional
        gamma squared of the flight's response; one where absent.
    points : int, optional
        Frequencies, even on a logarithmic axis, that dB, degrees and coherence are interpolated at;
        the given ones where None.

    Returns
    -------
    float
        nan where fewer than two frequencies are known.

    Raises
    ------
    UsageError
        Where shapes differ.

    Notes
    -----
    ``J = 20 / n sum W [dB^2 + 0.01745 deg^2]``, ``W = [1.58 (1 - exp(-gamma^2))]^2``: M. B. Tischler, R. K.
    Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., AIAA, 2012, sec. 11.2. Phase differences
    are unwrapped along the frequencies from within half a turn at the first.
    """
    f, gain, phase, weight = _mismatch(frequencies_hz, flight, simulation, coherence)
    if f.size < 2:
        return float("nan")
    if points is not None:
        at = np.geomspace(f[0], f[-1], points)
        gain, phase, weight = (np.interp(np.log(at), np.log(f), x) for x in (gain, phase, weight))
    trust = (1.58 * -np.expm1(-weight)) ** 2
    return float(20 / gain.size * np.sum(trust * (gain**2 + PHASE_WEIGHT * phase**2)))


def muad(frequencies_hz: ArrayLike, flight: ArrayLike, simulation: ArrayLike) -> Muad:
    """Compare the ratio of two frequency responses with the bounds of unnoticeable added dynamics.

    Parameters
    ----------
    frequencies_hz : array_like, shape (M,)
    flight, simulation : array_like of complex, shape (M,)

    Returns
    -------
    Muad
        Of flight over simulation, at the frequencies inside `MUAD_BAND` that both know.

    Raises
    ------
    UsageError
        Where shapes differ.
    """
    f, gain, phase, _ = _mismatch(frequencies_hz, flight, simulation, None)
    band = (2 * np.pi * f >= MUAD_BAND[0]) & (2 * np.pi * f <= MUAD_BAND[1])
    f = f[band]
    gains, phases = muad_bounds(2 * np.pi * f)
    return Muad(f, gain[band], phase[band], gains, phases)


def muad_bounds(frequency: ArrayLike) -> tuple[Array, Array]:
    """Return the envelopes of maximum unnoticeable added dynamics.

    Parameters
    ----------
    frequency : array_like, shape (M,)
        rad/s.

    Returns
    -------
    gain_db, phase_deg : ndarray, shape (2, M)
        Lower and upper bound.

    Notes
    -----
    J. R. Wood, J. Hodgkinson, *Definition of Acceptable Levels of Mismatch for Equivalent Systems of
    Augmented CTOL Aircraft*, McDonnell Aircraft report MDC A6792, 1980; MIL-STD-1797A, appendix, on
    equivalent systems; J. Hodgkinson, *Aircraft Handling Qualities*, Blackwell, 1999. Coefficients as they
    are commonly quoted from these; compare them with the standard before these bounds certify anything.
    """
    s = 1j * np.asarray(frequency, dtype=float)

    def ratio(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> NDArray[np.complex128]:
        return np.asarray(np.polyval(numerator, s) / np.polyval(denominator, s), dtype=np.complex128)

    def angle(numerator: tuple[float, ...], denominator: tuple[float, ...], time: float) -> Array:
        return np.degrees(np.angle(ratio(numerator, denominator)) + time * s.imag)

    gains = [20 * np.log10(np.abs(ratio(*g))) for g in (_LOWER_GAIN, _UPPER_GAIN)]
    return np.array(gains), np.array([angle(*p) for p in (_LOWER_PHASE, _UPPER_PHASE)])


def theil(measured: ArrayLike, predicted: ArrayLike) -> Theil:
    """Return Theil's inequality coefficient and the shares of the error.

    Parameters
    ----------
    measured, predicted : array_like, shape (sample,)

    Raises
    ------
    UsageError
        Where shapes differ.

    Notes
    -----
    ``U = rms(z - y) / (rms(z) + rms(y))``. R. V. Jategaonkar, *Flight Vehicle System Identification*,
    2nd ed., AIAA, 2015, sec. 11.2.3; H. Theil, *Economic Forecasts and Policy*, North-Holland, 1961.
    """
    z, y = _alike(measured, predicted)
    square = float(np.mean((z - y) ** 2))
    size = float(np.sqrt(np.mean(z**2)) + np.sqrt(np.mean(y**2)))
    if not square:
        return Theil(0.0, *[float("nan")] * 3)
    bias = float(z.mean() - y.mean()) ** 2 / square
    variance = float(z.std() - y.std()) ** 2 / square
    covariance = 2 * float(z.std() * y.std() - np.mean((z - z.mean()) * (y - y.mean()))) / square
    return Theil(float(np.sqrt(square)) / size, bias, variance, covariance)


def rmse(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Return the root mean square of the error, unit of the channels; UsageError where shapes differ."""
    z, y = _alike(measured, predicted)
    return float(np.sqrt(np.mean((z - y) ** 2)))


def _alike(measured: ArrayLike, predicted: ArrayLike) -> tuple[Array, Array]:
    z, y = np.asarray(measured, dtype=float), np.asarray(predicted, dtype=float)
    if z.shape != y.shape or z.ndim != 1 or not z.size:
        raise UsageError(f"histories of shapes {z.shape} and {y.shape} cannot be compared")
    return z, y


def _mismatch(
    frequencies_hz: ArrayLike, flight: ArrayLike, simulation: ArrayLike, coherence: ArrayLike | None
) -> tuple[Array, Array, Array, Array]:
    """Return frequencies, dB and degrees of flight over simulation, and coherence, where both are known."""
    f = np.asarray(frequencies_hz, dtype=float)
    a, b = np.asarray(flight, dtype=complex), np.asarray(simulation, dtype=complex)
    weight = np.ones(f.shape) if coherence is None else np.asarray(coherence, dtype=float)
    if not f.shape == a.shape == b.shape == weight.shape or f.ndim != 1:
        raise UsageError(
            f"responses of shapes {a.shape} and {b.shape} and coherence of {weight.shape} do not belong to "
            f"frequencies of {f.shape}"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = a / b
    known = np.isfinite(ratio) & (ratio != 0) & np.isfinite(weight)
    ratio = ratio[known]
    phase = np.degrees(np.unwrap(np.angle(ratio)))
    return f[known], 20 * np.log10(np.abs(ratio)), phase, weight[known]
