"""What the simulation knows of a condition: its linearisation, noise-free estimates, and why they differ."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.layout import Attribute, Dataset

Cause = Literal["noise", "amplitude", "wake delay", "not explained"]
BEYOND = 2.0
"""Standard errors from which an estimate is called off."""
PROMISED = 0.9545
"""Share of normal errors within two standard errors."""


def scatter_of_share(count: int) -> float:
    """Return two standard deviations of the share of independent errors that are within 2σ."""
    return 2 * math.sqrt(PROMISED * (1 - PROMISED) / count)


def as_many_as_by_chance(distances: Array) -> bool:
    """Return whether no more distances, in standard errors, are beyond 2σ than noise alone would leave."""
    outside = float(np.mean(np.abs(distances) > BEYOND)) if len(distances) else 0.0
    return not len(distances) or outside <= 1 - PROMISED + scatter_of_share(len(distances))


@dataclass(frozen=True)
class Miss:
    """A parameter that is off the linearisation, or off the noise-free estimate, or both.

    Attributes
    ----------
    parameter : str
    estimate, std_error, linear, noise_free : float
        Unit of the response per unit of the regressor.
    of : {"linearisation", "noise-free estimate", "both"}
        Which of the two it misses by more than `BEYOND` standard errors.
    cause : {"noise", "amplitude", "wake delay", "not explained"}
        The largest part of the difference from what it misses.
    parts : dict of str to float
        All parts of the estimate less the linearisation, in standard errors; they add up to the whole.
    """

    parameter: str
    estimate: float
    std_error: float
    linear: float
    noise_free: float
    of: Literal["linearisation", "noise-free estimate", "both"]
    cause: Cause
    parts: dict[Cause, float]

    @property
    def sigmas(self) -> float:
        """Estimate less linearisation, in standard errors."""
        return (self.estimate - self.linear) / self.std_error

    @property
    def by_noise_alone(self) -> bool:
        """Whether nothing but the noise part puts it off: without noise it would be within `BEYOND`."""
        rest = sum(x for cause, x in self.parts.items() if cause != "noise")
        return self.of == "noise-free estimate" or abs(rest) <= BEYOND


@dataclass(frozen=True, eq=False)
class KnownTruth:
    """The truth about one response at one condition, by three flights without noise.

    A linear model without memory, fitted to a flight of finite amplitude in an aircraft whose wakes arrive
    late, has other coefficients than the simulation's linearisation at the trim, even without noise.

    Attributes
    ----------
    regressors : tuple of str, length p
    linear : ndarray, shape (p,)
        Derivatives of the linearised simulation, wakes in their steady state.
    noise_free : ndarray, shape (p,)
        Estimate from the flight that was modelled, logged without any error.
    small : ndarray, shape (p,)
        The same from a flight of `scale` times the amplitude.
    no_wake : ndarray, shape (p,)
        `small` less linearisation of the same aircraft with its wakes switched off: what a small flight
        misses for other reasons than wakes.
    scale : float
    """

    regressors: tuple[str, ...]
    linear: Array
    noise_free: Array
    small: Array
    no_wake: Array
    scale: float

    def parts(self, estimate: Array) -> dict[Cause, Array]:
        """Return an estimate less the linearisation as a sum, each of shape (p,).

        ``noise``: estimate less `noise_free`. ``amplitude``: what goes when the same flight is flown small.
        ``wake delay``: what of the rest goes when the aircraft has no wakes. ``not explained``: what stays.
        """
        return {
            "noise": estimate - self.noise_free,
            "amplitude": self.noise_free - self.small,
            "wake delay": self.small - self.linear - self.no_wake,
            "not explained": self.no_wake,
        }

    def misses(self, estimate: Array, std_error: Array) -> tuple[Miss, ...]:
        """Return the parameters that are off either by more than `BEYOND` standard errors, farthest first.

        Parameters
        ----------
        estimate, std_error : ndarray, shape (p,)
            As they were identified, with noise.
        """
        parts, found = self.parts(estimate), []
        for j, name in enumerate(self.regressors):
            if not std_error[j] > 0:
                continue
            each: dict[Cause, float] = {cause: float(part[j] / std_error[j]) for cause, part in parts.items()}
            off_linear = abs(sum(each.values())) > BEYOND
            off_noise_free = abs(each["noise"]) > BEYOND
            if not (off_linear or off_noise_free):
                continue
            # What is off the noise-free estimate alone is off by noise, whatever the other parts are.
            cause = max(each, key=lambda c: abs(each[c])) if off_linear else "noise"
            found.append(
                Miss(
                    name,
                    float(estimate[j]),
                    float(std_error[j]),
                    float(self.linear[j]),
                    float(self.noise_free[j]),
                    "both"
                    if off_linear and off_noise_free
                    else "linearisation"
                    if off_linear
                    else "noise-free estimate",
                    cause,
                    each,
                )
            )
        return tuple(sorted(found, key=lambda m: -abs(m.sigmas)))

    def from_noise_free(self, estimate: Array, std_error: Array) -> Array:
        """Return estimates less the noise-free ones, in standard errors, shape (p,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (estimate - self.noise_free) / std_error


_P = ("regressors",)
LAYOUT = {
    "regressors": Attribute("truth/{response}@regressors", json=True),
    "scale": Attribute("truth/{response}@scale"),
    **{
        name: Dataset(f"truth/{{response}}/{name}", "mixed", _P)
        for name in ("linear", "noise_free", "small", "no_wake")
    },
}
