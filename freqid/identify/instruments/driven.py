"""Instruments: what the injected signals alone would have made of a manoeuvre.

Sensor noise and gusts move the measured regressors, and feedback sends both on to the effectors; the injected
signals are the one thing that is known exactly and owes nothing to either. Sent through a model of the
closed loop they give histories that resemble the regressors and share none of their noise
(docs/theory/instruments.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from freqid.core.arrays import Array, Complex
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.instruments.loop_model import LoopModel, fit_loop
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.model.line_equations import LineEquations, on_lines
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.regress.two_stage import LEAST_STRENGTH, two_stage_least_squares

MOTION = ("u", "v", "w", "p", "q", "r")
# A velocity or rate that moves by less than this share of the others rests but for rounding.
STILL = 1e-9
# First-stage F that a regressor which the signals do not reach exceeds once in twenty times.
REACHED = 4.0


def driven_maneuvers(
    maneuvers: Sequence[Maneuver], lines_hz: Array, settings: Identification
) -> tuple[Maneuver, ...]:
    """Return manoeuvres as the injected signals alone would have made them.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        With the injected signals in their group ``excitation``, all flown with the same control law.
    lines_hz : ndarray, shape (M,)
        Hz, ascending; the closed loop is modelled there.
    settings : Identification
        The effectors among its regressors move; the others rest at their means.

    Returns
    -------
    tuple of Maneuver
        Motion and effectors about the means that were flown, on the same samples. Air data are left out, so
        that they are computed.

    Raises
    ------
    UsageError
        Where a record holds no injected signals.
    DataError
        Where a channel is missing, or lines are too few for a model of the closed loop.

    Notes
    -----
    All six components of the wrench are fitted on motion and effectors by least squares; with the equations
    of motion and a fitted control law they make a closed loop; its response to the injected signals makes
    instruments for a second, better fit, and that the instruments that are returned.
    """
    loop, flights = _fitted(maneuvers, lines_hz, settings)
    return tuple(_flown_so(m, f, f.driven(loop, lines_hz)) for m, f in zip(maneuvers, flights, strict=True))


def driven_loop(maneuver: Maneuver, lines_hz: Array, settings: Identification) -> tuple[LoopModel, Array]:
    """Return the closed loop fitted to a manoeuvre, and what the injected signals make of it.

    Parameters
    ----------
    maneuver : Maneuver
    lines_hz : ndarray, shape (M,)
    settings : Identification
        As for `driven_maneuvers`, which says what is raised.

    Returns
    -------
    LoopModel
    ndarray, shape (6 + n, sample)
        Of u v w p q r and the moving effectors, about their means.
    """
    loop, (flight,) = _fitted([maneuver], lines_hz, settings)
    return loop, flight.driven(loop, lines_hz)


def _fitted(
    maneuvers: Sequence[Maneuver], lines_hz: Array, settings: Identification
) -> tuple[LoopModel, list[_Flight]]:
    """Return the closed loop of manoeuvres, and these as the loop sees them."""
    named = {n for r in settings.responses for n in settings.regressors_of(r)}
    effectors = tuple(n for n in maneuvers[0].record.group("effector") if n in named)
    flights = [_Flight.of(m, effectors) for m in maneuvers]
    wrenches = [applied_wrench(m, angular_acceleration=settings.angular_acceleration) for m in maneuvers]
    dt = [m.record.dt for m in maneuvers]

    def equations(histories: list[Array]) -> LineEquations:
        return on_lines(histories, wrenches, dt, lines_hz)

    measured = equations([f.moved for f in flights])
    injected = equations([f.injected for f in flights]).x
    names = [*MOTION, *effectors]
    moving = _moving(measured.x)
    wrench = np.zeros((6, len(names)))
    wrench[:, moving] = least_squares(
        measured.x[moving],
        measured.z,
        names=[n for n, m in zip(names, moving, strict=True) if m],
        response_names=WRENCH,
        nuisance=measured.nuisance,
    ).estimate
    loop = fit_loop(maneuvers, effectors, measured, injected, wrench, moving)
    loop = _refined(loop, measured, moving, lambda by: equations([f.driven(by, lines_hz) for f in flights]).x)
    return loop, flights


def _refined(
    loop: LoopModel,
    measured: LineEquations,
    moving: NDArray[np.bool_],
    driven_by: Callable[[LoopModel], Complex],
) -> LoopModel:
    """Return the loop with the wrench that its own instruments find; a third round changes nothing any more.

    What the injected signals do not reach, as the lateral motion of a longitudinal manoeuvre, is left at
    rest: its columns are noise. But in strong noise the first loop may be too wrong to tell: then whichever
    of the two has instruments that are all strong enough is taken before anything is left at rest.
    """
    driven = driven_by(loop)
    reached = moving & _moving(driven)

    def fitted(instruments: Complex) -> tuple[LeastSquares, Array]:
        x, z = measured.x[reached], measured.z
        return two_stage_least_squares(x, z, instruments[reached], nuisance=measured.nuisance)

    def refitted() -> LoopModel:
        wrench = np.zeros_like(loop.wrench)
        wrench[:, reached] = fit.estimate
        return replace(loop, wrench=wrench, moving=np.concatenate([reached[:6], reached[[3, 4]]]))

    fit, strength = fitted(driven)
    second = driven_by(refitted())
    if _moving(second)[reached].all() and (fitted(second)[1] >= LEAST_STRENGTH).all():
        return refitted()
    if (strength >= LEAST_STRENGTH).all():
        return loop
    while (strength < REACHED).any():  # one at a time: what is weak makes its neighbours look weak
        reached[np.flatnonzero(reached)[np.argmin(strength)]] = False
        fit, strength = fitted(driven)
    return refitted()


def _moving(x: Complex) -> NDArray[np.bool_]:
    """Tell, shape (6 + n,), which of u v w p q r and effectors move; a simulation may leave some at rest."""
    size = np.linalg.norm(x, axis=1)
    kinds = size[:6].reshape(2, 3)  # velocities, rates: rounding is small beside the largest of its kind
    return np.concatenate([(kinds > STILL * kinds.max(axis=1, keepdims=True)).ravel(), size[6:] > 0])


@dataclass(frozen=True, eq=False)
class _Flight:
    """One manoeuvre as the loop sees it: u v w p q r and effectors (6 + n, sample), injected (n, sample)."""

    effectors: tuple[str, ...]
    units: tuple[str, ...]
    moved: Array
    injected: Array
    dt: float

    @classmethod
    def of(cls, maneuver: Maneuver, effectors: tuple[str, ...]) -> _Flight:
        record = maneuver.record
        injected = np.array(
            [
                record[f"excitation/{e}"] if f"excitation/{e}" in record else np.zeros(record.time.size)
                for e in effectors
            ]
        )
        if not injected.any():
            raise UsageError(
                "instruments need the injected signals, but the record holds none in excitation/<effector> "
                "of an effector among the regressors",
                remedy="import them with the log, or use the estimator 'least-squares'",
            )
        moved, units = explanatory_variables(maneuver, (*MOTION, *effectors))
        return cls(effectors, units, moved, injected, record.dt)

    def driven(self, loop: LoopModel, lines_hz: Array) -> Array:
        """Return what the injected signals make of motion and effectors, shape (6 + n, sample)."""
        samples = self.injected.shape[1]
        padded = next_fast_len(2 * samples, real=True)  # what rings on at the end must not come round
        frequencies = rfftfreq(padded, self.dt)
        margin = 1.0 / (samples * self.dt)
        # The law was fitted in the band and says nothing outside it.
        lowest = max(lines_hz[0] - margin, 0.0)
        band = (frequencies > lowest) & (frequencies < lines_hz[-1] + margin)
        spectrum = np.zeros((len(self.moved), frequencies.size), dtype=complex)
        spectrum[:, band] = loop.response(frequencies[band], rfft(self.injected, padded)[:, band])
        return irfft(spectrum, padded)[:, :samples]


def _flown_so(maneuver: Maneuver, flight: _Flight, driven: Array) -> Maneuver:
    """Return a manoeuvre with other motion and effector positions; all else at its mean."""
    record = maneuver.record
    computed = {f"air/{n}" for n in ("V", "alpha", "beta", "qbar", "phat", "qhat", "rhat")}
    channels = {
        name: replace(channel, values=np.full_like(channel.values, channel.values.mean()))
        for name, channel in record.channels.items()
        if name.startswith(("state/", "air/", "effector/")) and name not in computed
    }
    level = flight.moved.mean(axis=1, keepdims=True)
    paths = [f"state/{n}" for n in MOTION] + [f"effector/{n}" for n in flight.effectors]
    for path, unit, values in zip(paths, flight.units, level + driven, strict=True):
        channels[path] = Channel(path, unit, values, 1 / record.dt, "driven by the injected signals")
    return Maneuver(FlightRecord(record.time, channels), maneuver.vehicle)
