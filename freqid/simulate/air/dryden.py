"""Wind and low-altitude Dryden turbulence, made before the flight as an input to it.

The six shaping filters are one linear system driven by four white noises; it is sampled exactly, so
its spectrum and its variance do not depend on the step. The field is frozen: it passes at the airspeed
of the reference condition, which is what the specification describes.

References
----------
MIL-F-8785C, *Flying Qualities of Piloted Airplanes*, 1980, sections 3.7.2 and 3.7.3.4 (Dryden form,
scales and intensities below 1000 ft).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm, solve_continuous_lyapunov

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.units import FOOT
from freqid.core.vehicle import Strict

HEIGHT_RANGE = (10 * FOOT, 1000 * FOOT)  # where the low-altitude model is stated, m
SLOWEST = 1.0  # m/s; a frozen field does not pass a vehicle that stands in it


class WindSection(Strict, frozen=True):
    """``[simulation.wind.<name>]``: a kind of day.

    Attributes
    ----------
    speed : tuple of 2 floats
        Of the mean wind 20 ft above ground, m/s, from and to; drawn once a flight with its direction.
    """

    speed: tuple[float, float]

    def __post_init__(self) -> None:
        if not 0 <= self.speed[0] <= self.speed[1]:
            raise ValueError(f"speed is {list(self.speed)}, expected the lower one first and none negative")


@dataclass(frozen=True)
class Dryden:
    """Scales and intensities of turbulence.

    Attributes
    ----------
    sigma : tuple of 3 floats
        One sigma of u, v, w, m/s.
    length : tuple of 3 floats
        Scales L_u, L_v, L_w, m.
    span : float
        Wing span b, m; gusts shorter than it turn the vehicle less.
    airspeed : float
        At which the field passes, m/s.
    """

    sigma: tuple[float, float, float]
    length: tuple[float, float, float]
    span: float
    airspeed: float

    def spectrum(self, omega: Array) -> Array:
        """Return the one-sided spectral densities of u, v, w, p, q, r, per rad/s, shape (6, frequency).

        Their integral over angular frequency from 0 to infinity is the variance.
        """
        (su, sv, sw), (lu, lv, lw) = self.sigma, self.length
        wave, b = omega / self.airspeed, self.span

        def lateral(sigma: float, length: float) -> Array:
            x = (length * wave) ** 2
            return sigma**2 * length / np.pi * (1 + 3 * x) / (1 + x) ** 2

        u = su**2 * 2 * lu / np.pi / (1 + (lu * wave) ** 2)
        v, w = lateral(sv, lv), lateral(sw, lw)
        p = sw**2 / lw * 0.8 * (np.pi * lw / (4 * b)) ** (1 / 3) / (1 + (4 * b * wave / np.pi) ** 2)
        q = wave**2 / (1 + (4 * b * wave / np.pi) ** 2) * w
        r = wave**2 / (1 + (3 * b * wave / np.pi) ** 2) * v
        return np.stack((u, v, w, p, q, r)) / self.airspeed


def steady_wind(scenario: Scenario, name: str, seed: int) -> Array:
    """Return the mean wind of a flight: velocity of the air north, east, down, m/s, shape (3,).

    Raises
    ------
    UsageError
        Where ``[simulation.wind]`` has none of that name, or unknown keys.
    """
    days = scenario.simulation.wind
    if name not in days:
        raise UsageError(f"the scenario has no wind '{name}'", remedy=nearest(name, days))
    day = convert(days[name], WindSection, f"[simulation.wind.{name}]")
    rng = np.random.default_rng([seed, *b"wind"])
    speed, direction = rng.uniform(*day.speed), rng.uniform(-np.pi, np.pi)
    return speed * np.array([np.cos(direction), np.sin(direction), 0.0])


def low_altitude(wind_20ft: float, height: float, airspeed: float, span: float) -> Dryden:
    """Return the turbulence below 1000 ft.

    Parameters
    ----------
    wind_20ft : float
        Mean wind 20 ft above ground, m/s, which sets the intensity: 7.7 is light, 15 moderate, 23 severe.
    height : float
        Above ground, m.
    airspeed : float
        m/s; in hover, that of the mean wind.
    span : float
        m.

    Raises
    ------
    UsageError
        Where height or airspeed is outside the model.
    """
    low, high = HEIGHT_RANGE
    if not low <= height <= high:
        raise UsageError(
            f"turbulence is stated from {low:.4g} to {high:.4g} m above ground, not at {height:.4g} m",
            remedy="change the height or fly without turbulence",
        )
    if airspeed < SLOWEST:
        raise UsageError(
            f"turbulence needs an airspeed of at least {SLOWEST:g} m/s, not {airspeed:.3g} m/s",
            remedy="add a steady wind or fly without turbulence",
        )
    feet = height / FOOT
    ratio = 0.177 + 0.000823 * feet
    sigma_w = 0.1 * wind_20ft
    sigma_u = sigma_w / ratio**0.4
    length_u = height / ratio**1.2
    return Dryden((sigma_u, sigma_u, sigma_w), (length_u, length_u, height), span, airspeed)


def gusts(turbulence: Dryden, samples: int, dt: float, seed: int) -> Array:
    """Return a piece of turbulence.

    Parameters
    ----------
    turbulence : Dryden
    samples : int
    dt : float
        s.
    seed : int

    Returns
    -------
    ndarray, shape (6, sample)
        Velocity of the air, m/s, and its rotation, rad/s, in level axes along the flight path:
        u along it, v right, w down; p, q, r about them. The rotations follow the field's gradients:
        ``r = dv/dx``, ``q = -dw/dx``.
    """
    dynamics, drive, output = _shaping_filters(turbulence)
    rng = np.random.default_rng(seed)
    steady = solve_continuous_lyapunov(dynamics, -drive @ drive.T)
    transition = expm(dynamics * dt)
    noise = steady - transition @ steady @ transition.T  # what a step has to add, whatever its length
    state = _root(steady) @ rng.standard_normal(len(dynamics))  # the field was there before the flight
    shocks = _root(noise) @ rng.standard_normal((len(dynamics), samples))
    states = np.empty_like(shocks)
    for k in range(samples):
        states[:, k] = state
        state = transition @ state + shocks[:, k]
    return output @ states


def _shaping_filters(turbulence: Dryden) -> tuple[Array, Array, Array]:
    """Return the filters as one system ``x' = A x + B n``, gust ``= C x``, n of unit two-sided density."""
    (su, sv, sw), (lu, lv, lw) = turbulence.sigma, turbulence.length
    speed, b = turbulence.airspeed, turbulence.span
    tau = 4 * b / (np.pi * speed)
    a_v, b_v, gust_v, gradient_v = _lateral(sv, lv, speed, 3 * b / (np.pi * speed))
    a_w, b_w, gust_w, gradient_w = _lateral(sw, lw, speed, tau)
    dynamics, drive = np.zeros((8, 8)), np.zeros((8, 4))
    dynamics[0, 0], drive[0, 0] = -speed / lu, speed / lu
    dynamics[1:4, 1:4], drive[1:4, 1] = a_v, b_v
    dynamics[4:7, 4:7], drive[4:7, 2] = a_w, b_w
    dynamics[7, 7], drive[7, 3] = -1 / tau, 1 / tau
    output = np.zeros((6, 8))
    output[0, 0] = su * np.sqrt(2 * lu / speed)
    output[1, 1:4], output[2, 4:7] = gust_v, gust_w
    output[3, 7] = sw * np.sqrt(0.8 * np.pi / speed) * (np.pi / (4 * b)) ** (1 / 6) / lw ** (1 / 3)
    output[4, 4:7], output[5, 1:4] = -gradient_w, gradient_v
    return dynamics, drive, output


def _lateral(sigma: float, length: float, speed: float, tau: float) -> tuple[Array, Array, Array, Array]:
    """Return A, B and the outputs of a transverse gust and of its gradient along the path.

    The gust is ``sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2`` with ``T = L / V``, the gradient
    ``(s / V) / (1 + tau s)`` of it.
    """
    time = length / speed
    gust = sigma * np.sqrt(time) * np.array([np.sqrt(3), 1 - np.sqrt(3), 0])
    dynamics = np.array([[-1 / time, 0, 0], [1 / time, -1 / time, 0], [0, 0, -1 / tau]])
    dynamics[2] += gust / tau
    gradient = (gust - np.array([0, 0, 1.0])) / (tau * speed)
    return dynamics, np.array([1 / time, 0, 0]), gust, gradient


def _root(covariance: NDArray[np.floating]) -> Array:
    """Return a matrix whose product with its transpose is a covariance that may be singular."""
    values, vectors = eigh((covariance + covariance.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0))
