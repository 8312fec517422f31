"""The regression that a design will lead to: columns, response and sensor noise on every line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import MassProperties, Vector
from freqid.design.forecast.closed_loop import SPECIFIC_FORCES, STATES, PerturbedAircraft
from freqid.design.multisine.signals import band_lines, tones
from freqid.dynamics.frames import cross

# Least eigenvalue of the correlation of columns that is more than rounding.
SEPARABLE = 1e-12


@dataclass(frozen=True, eq=False)
class Equation:
    """One response on its q nuisance columns and p regressors over M lines, and noise of s sensors.

    Attributes
    ----------
    name : str
        Response.
    regressors : tuple of str, length p
    nuisances : int
        q; they are the first columns.
    columns : ndarray of complex, shape (q + p, M)
        Transforms without noise, unit times s.
    response : ndarray of complex, shape (M,)
        N s or N m s.
    column_noise : ndarray, shape (q + p, s)
        What a sensor's error adds to a column.
    response_noise : ndarray of complex, shape (M, s)
        What it adds to the response, by line: the derivative of a rate grows with frequency.
    variance : ndarray, shape (s,)
        Of the transform of a sensor's noise on a line, ``E|n(f)|^2 = sigma^2 dt T``.
    """

    name: str
    regressors: tuple[str, ...]
    nuisances: int
    columns: Complex
    response: Complex
    column_noise: Array
    response_noise: Complex
    variance: Array


@dataclass(frozen=True, eq=False)
class Experiment:
    """Transforms of everything that a design moves, in the steady state of the closed loop.

    Attributes
    ----------
    loop : PerturbedAircraft
    settings : Identification
    frequencies_hz : ndarray, shape (line,)
        The harmonics of the design's band.
    transforms : ndarray of complex, shape (8 + n, line)
        Of states and effector positions, unit times s.
    noise : mapping of str to float
    interval_duration : float
        dt T, s2: what turns the variance of a sample into that of a transform.
    arm : ndarray, shape (3,)
        Accelerometers from the centre of gravity, m.
    """

    loop: PerturbedAircraft
    settings: Identification
    frequencies_hz: Array
    transforms: Complex
    noise: Mapping[str, float]
    interval_duration: float
    arm: Array

    @classmethod
    def of(
        cls,
        design: MultisineDesign,
        loop: PerturbedAircraft,
        settings: Identification,
        noise: Mapping[str, float],
        accelerometer_m: Vector | None,
    ) -> Experiment:
        """Fly a design on the model; arguments as for `freqid.design.forecast.standard_errors.forecast`."""
        if (settings.form, settings.axes) != ("force", "body"):
            raise UsageError(
                f"the forecast is of forces and moments in body axes, not of the form '{settings.form}' in "
                f"{settings.axes} axes",
                remedy="set form 'force' and axes 'body', or scale its result",
            )
        lines = band_lines(design)
        frequencies = lines / design.period_s
        x = loop.motion(design.names, tones(design, lines), frequencies)
        cg = loop.vehicle.mass_properties.cg_m
        return cls(
            loop=loop,
            settings=settings,
            frequencies_hz=frequencies,
            transforms=-0.5j * design.duration_s * x,  # of Im(c exp(j w t)) over whole periods
            noise=noise,
            interval_duration=design.dt_s * design.duration_s,
            arm=np.subtract(accelerometer_m or cg, cg),
        )

    def equation(self, response: str) -> Equation:
        """Return the regression of one response.

        Raises
        ------
        UsageError
            Where a regressor does not move, the design cannot separate some, or a noise level is missing.
        """
        regressors = self.settings.regressors_of(response)
        rows = self.loop.rows(regressors)
        phi = rows @ self.transforms
        rounding = 1e-14 * np.linalg.norm(self.transforms)
        still = np.flatnonzero(np.linalg.norm(phi, axis=1) <= rounding)
        if still.size:
            raise UsageError(
                f"regressor '{regressors[still[0]]}' of '{response}' does not move in this design",
                remedy="excite it or drop it from the regressors",
            )
        nuisance = self._nuisance()
        _refuse_inseparable(np.concatenate([phi, nuisance]), regressors, response)
        to_sensors = np.zeros((len(nuisance) + len(regressors), rows.shape[1] + 3))
        to_sensors[len(nuisance) :, : rows.shape[1]] = rows
        response_noise = self._response_noise(WRENCH.index(response))
        heard = np.abs(np.concatenate([to_sensors, response_noise])).max(axis=0) > 0
        return Equation(
            name=response,
            regressors=regressors,
            nuisances=len(nuisance),
            columns=np.concatenate([nuisance, phi]),
            response=self.loop.wrench[WRENCH.index(response)] @ self.transforms,
            column_noise=to_sensors,
            response_noise=response_noise,
            variance=self._variance(heard, response),
        )

    def _response_noise(self, row: int) -> Complex:
        """Return what errors of states, positions and accelerometers add to a response, (line, sensor)."""
        loop = self.loop
        mass = loop.vehicle.mass_properties
        return response_noise(row, mass, loop.spin, loop.momentum, self.arm, self.frequencies_hz)

    def _nuisance(self) -> Complex:
        """Return the columns that absorb a trend, and the end samples of a derivative, which are constant."""
        one = np.ones(self.frequencies_hz.size, dtype=complex)
        if self.settings.nuisance == "none":
            return np.empty((0, one.size), dtype=complex)
        if self.settings.nuisance == "constant":
            return one[None]
        trend = 1j * (1.0 / self.frequencies_hz)
        moments = any(r in WRENCH[3:] for r in self.settings.responses)
        return np.array([trend, one] if moments or self.arm.any() else [trend], dtype=complex)

    def _variance(self, heard: NDArray[np.bool_], response: str) -> Array:
        sensors = (*STATES, *self.loop.effectors, *SPECIFIC_FORCES)
        missing = [
            name for name, needed in zip(sensors, heard, strict=True) if needed and name not in self.noise
        ]
        if missing:
            raise UsageError(
                f"the noise of {', '.join(missing)} is not stated, and response '{response}' depends on it",
                remedy="give one sigma of each in [noise], zero where it is negligible",
            )
        sigma = np.array([self.noise[n] if needed else 0.0 for n, needed in zip(sensors, heard, strict=True)])
        if not sigma.any():
            raise UsageError(
                f"all noise that response '{response}' depends on is zero, so that nothing is uncertain",
                remedy="state the sensors' noise",
            )
        return sigma**2 * self.interval_duration


def response_noise(
    row: int, mass: MassProperties, spin: Array, momentum: Array, arm: Array, frequencies_hz: Array
) -> Complex:
    """Return what errors of sensors add to a reconstructed wrench.

    Parameters
    ----------
    row : int
        Of X Y Z L M N.
    mass : MassProperties
    spin : ndarray, shape (3, n)
        Rotors' angular momentum per unit of effector position, kg m2.
    momentum : ndarray, shape (3,)
        Of all rotors at the trim, N m s.
    arm : ndarray, shape (3,)
        Accelerometers from the centre of gravity, m.
    frequencies_hz : ndarray, shape (line,)

    Returns
    -------
    ndarray of complex, shape (line, 8 + n + 3)
        By state, effector position and accelerometer, N and N m per SI unit.
    """
    s = 2j * np.pi * frequencies_hz
    unknowns, axis = 8 + spin.shape[1], row % 3
    k = np.zeros((s.size, unknowns + 3), dtype=complex)
    if row < 3:  # m (a - w' x arm)
        k[:, unknowns + axis] = mass.mass_kg
        k[:, 3:6] = -mass.mass_kg * np.outer(s, _cross_with(arm)[axis])
    else:  # I w' + S d' + w x h0
        k[:, 3:6] = np.outer(s, mass.inertia.matrix[axis]) + _cross_with(momentum)[axis]
        k[:, 8:unknowns] = np.outer(s, spin[axis])
    return k


def refuse_unidentified(settings: Identification, wanted: Mapping[str, Mapping[str, float]]) -> None:
    """Raise where a standard error is wanted of what is not identified, or is not positive."""
    for response, row in wanted.items():
        regressors = settings.regressors_of(response) if response in settings.responses else ()
        for regressor, error in row.items():
            if regressor not in regressors or not error > 0:
                raise UsageError(
                    f"a standard error of {error:g} is wanted of '{regressor}' in '{response}', expected a "
                    "positive one of a parameter that is identified",
                    remedy="correct the wanted accuracy or the regressors",
                )


def _refuse_inseparable(columns: Complex, regressors: tuple[str, ...], response: str) -> None:
    """Raise where a combination of regressors, whatever their units, vanishes on all lines."""
    unit = columns / np.linalg.norm(columns, axis=1)[:, None]
    values, vectors = np.linalg.eigh((unit.conj() @ unit.T).real)
    if values[0] > SEPARABLE:
        return
    names = [n for n, share in zip(regressors, np.abs(vectors[:, 0]), strict=False) if share > 0.1]
    raise UsageError(
        f"the design does not separate {', '.join(names)} in response '{response}'",
        remedy="excite more effectors, give them more harmonics, or drop regressors",
    )


def _cross_with(v: Array) -> Array:
    """Return the matrix of ``w x v`` in w, shape (3, 3)."""
    return cross(np.eye(3), v[:, None] * np.ones(3))
