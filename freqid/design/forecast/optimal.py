"""Amplitudes that make a design as informative as limits on effectors, motion and loads allow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Vector
from freqid.design.forecast.closed_loop import PerturbedAircraft
from freqid.design.forecast.experiment import Experiment, refuse_unidentified
from freqid.design.forecast.limits import PeakLimits
from freqid.design.multisine.signals import band_lines

# An effector that little is to be learnt from is not turned down below this share of what it may do.
LEAST_SHARE = 0.01
# Peaks are added to the problem until none exceeds its limit by more than this.
EXCESS = 1e-3
ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Optimum:
    """A design with its best amplitudes.

    Attributes
    ----------
    criterion : {"A", "D"}
    design : MultisineDesign
        The one given, each signal multiplied by its scale.
    scale : ndarray, shape (effector,)
    binding : tuple of str
        What keeps the amplitudes from growing: channels at their limit, ``rate of`` some.
    figure : float
        Value of the criterion: for D minus the mean logarithm of the information per parameter, own
        units; for A the logarithm of the mean squared ratio of standard error to `wanted`.
    """

    criterion: Literal["A", "D"]
    design: MultisineDesign
    scale: Array
    binding: tuple[str, ...]
    figure: float


def optimal_amplitudes(
    design: MultisineDesign,
    loop: PerturbedAircraft,
    settings: Identification,
    noise: Mapping[str, float],
    allowed: Mapping[str, float],
    allowed_rate: Mapping[str, float] | None = None,
    *,
    criterion: Literal["A", "D"] = "D",
    wanted: Mapping[str, Mapping[str, float]] | None = None,
    accelerometer_m: Vector | None = None,
) -> Optimum:
    """Scale the signals of a design for the least uncertainty within limits; harmonics and phases stay.

    Parameters
    ----------
    design, loop, settings, noise, accelerometer_m
        As for `freqid.design.forecast.standard_errors.forecast`.
    allowed : mapping of str to float
        Largest deviation from the trim by channel of `PerturbedAircraft.rows`, SI, feedback included:
        effectors (`freqid.design.forecast.limits.effector_travel`), states, ``X`` to ``N`` for net loads.
    allowed_rate : mapping of str to float, optional
        Largest rate of change by channel, SI per s.
    criterion : {"A", "D"}
        "D" makes ``det(F)`` of all parameters largest; "A" the mean of their variances smallest, each
        relative to `wanted`.
    wanted : mapping of str to mapping of str to float, optional
        For "A": standard errors by response and regressor; those of the design as given where absent.

    Returns
    -------
    Optimum

    Raises
    ------
    UsageError
        Where two effectors share a harmonic, a limit is not positive, nothing limits an effector, the
        design cannot separate the regressors, or `wanted` names what is not identified.

    Notes
    -----
    On disjoint combs information is linear in the squared scales, and every channel at every moment is
    linear in the scales, so that the limits are on true peaks. They are met by adding the moments at
    which a solution exceeds them (Kelley, 1960); each problem is solved by sequential quadratic
    programming in log(scale) with exact gradients, from two starts. The noise in the regressors counts
    as residual only, as in the first order of `freqid.design.forecast.standard_errors.forecast`.

    References
    ----------
    Atkinson, Donev & Tobias, *Optimum Experimental Designs, with SAS*, 2007 (A- and D-optimality);
    Kelley, "The cutting-plane method for solving convex programs", J. SIAM 8(4), 1960.
    """
    refuse_unidentified(settings, wanted or {})
    experiment = Experiment.of(design, loop, settings, noise, accelerometer_m)
    owner = _owners(design)
    information = _Information(experiment, owner, len(design.signals), criterion, wanted)
    limits = PeakLimits(design, loop, owner, allowed, allowed_rate or {})
    best = min(
        (_descend(information, limits, start) for start in limits.starts()), key=lambda found: found[0]
    )
    scale = best[1]
    peak = limits.peaks(scale)
    signals = tuple(
        replace(signal, amplitude=signal.amplitude * factor)
        for signal, factor in zip(design.signals, scale, strict=True)
    )
    binding = tuple(name for name, p in zip(limits.names, peak, strict=True) if p > 1 - 10 * EXCESS)
    provenance = {
        **design.provenance,
        "amplitudes": f"{criterion}-optimal, held back by {', '.join(binding)}",
        "scale": [float(f"{factor:.6g}") for factor in scale],
    }
    return Optimum(
        criterion=criterion,
        design=replace(design, signals=signals, provenance=provenance),
        scale=scale,
        binding=binding,
        figure=best[0],
    )


def _owners(design: MultisineDesign) -> NDArray[np.int64]:
    """Return the effector that excites each line of the band, -1 where none does."""
    lines = band_lines(design)
    owner = np.full(lines.size, -1)
    for e, signal in enumerate(design.signals):
        at = np.searchsorted(lines, signal.index)
        taken = at[(owner[at] >= 0) & (owner[at] != e)]
        if taken.size:
            raise UsageError(
                f"'{signal.name}' and '{design.names[owner[taken[0]]]}' share harmonic {lines[taken[0]]}, so "
                "that their amplitudes cannot be judged apart",
                remedy="give each effector harmonics of its own",
            )
        owner[at] = e
    return owner


class _Information:
    """The criterion as a function of log(scale), with its gradient."""

    def __init__(
        self,
        experiment: Experiment,
        owner: NDArray[np.int64],
        effectors: int,
        criterion: str,
        wanted: Mapping[str, Mapping[str, float]] | None,
    ):
        self.criterion = criterion
        # By response: normal matrix and scatter, both by effector, and the weight of each parameter.
        self.parts: list[tuple[Array, Array, Array]] = []
        self.offset = 0.0
        for response in experiment.settings.responses:
            equation = experiment.equation(response)
            x, g = equation.columns[equation.nuisances :], equation.column_noise[equation.nuisances :]
            length = np.linalg.norm(x, axis=1)
            x, g = x / length[:, None], g / length[:, None]
            gram = (x.conj() @ x.T).real
            theta = np.linalg.solve(gram, (x.conj() @ equation.response).real)
            s = np.abs(equation.response_noise - theta @ g) ** 2 @ equation.variance
            normal = np.empty((effectors, len(x), len(x)))
            scatter = np.empty_like(normal)
            for e in range(effectors):
                own = x[:, owner == e]
                normal[e] = (own.conj() @ own.T).real
                scatter[e] = 0.5 * ((own.conj() * s[owner == e]) @ own.T).real
            inverse = np.linalg.inv(normal.sum(axis=0))
            error = np.sqrt(np.diag(inverse @ scatter.sum(axis=0) @ inverse))
            asked = (wanted or {}).get(response, {})
            goal = [
                asked.get(n, e / k) * k for n, e, k in zip(equation.regressors, error, length, strict=True)
            ]
            self.parts.append((normal, scatter, 1 / np.square(goal)))
            self.offset -= 2 * np.log(length).sum()
        self.count = sum(len(weight) for *_, weight in self.parts)

    def __call__(self, log_scale: Array) -> tuple[float, Array]:
        power = np.exp(2 * log_scale)
        value, gradient = 0.0, np.zeros_like(power)
        for normal, scatter, weight in self.parts:
            h, b = np.tensordot(power, normal, 1), np.tensordot(power, scatter, 1)
            inverse = np.linalg.inv(h)
            if self.criterion == "D":
                value += np.linalg.slogdet(b)[1] - 2 * np.linalg.slogdet(h)[1]
                by_scatter, by_normal = np.linalg.inv(b), 2 * inverse
            else:
                covariance = inverse @ b @ inverse
                value += np.diag(covariance) @ weight
                by_scatter, by_normal = inverse * weight @ inverse, 2 * (covariance * weight) @ inverse
            gradient += np.tensordot(scatter, by_scatter, 2) - np.tensordot(normal, by_normal, 2)
        gradient *= 2 * power
        if self.criterion == "D":
            return float(value + self.offset) / self.count, gradient / self.count
        return float(np.log(value / self.count)), gradient / value


def _descend(information: _Information, limits: PeakLimits, start: Array) -> tuple[float, Array]:
    """Return the criterion and the scales of a local optimum that keeps all limits."""
    x = np.log(start)
    lower, upper = np.log(LEAST_SHARE * limits.alone), np.log(limits.alone)
    cuts = limits.cuts(start, 0.9)
    for _ in range(ROUNDS):
        within: Any = {  # scipy's stubs know no constraint of many values
            "type": "ineq",
            "fun": lambda x, g=cuts: 1 - g @ np.exp(x),
            "jac": lambda x, g=cuts: -g * np.exp(x),
        }
        solved = minimize(
            information,
            np.clip(x, lower, upper),
            jac=True,
            method="SLSQP",
            bounds=list(zip(lower, upper, strict=True)),
            constraints=within,
            options={"ftol": 1e-10, "maxiter": 300},
        )
        x = solved.x
        excess = limits.peaks(np.exp(x)).max() - 1
        if excess < EXCESS:
            break
        cuts = np.concatenate([cuts, limits.cuts(np.exp(x), 1 + 0.5 * EXCESS)])
    x -= np.log(max(limits.peaks(np.exp(x)).max(), 1.0))  # the last of the excess, and all if rounds ran out
    return information(x)[0], np.exp(x)
