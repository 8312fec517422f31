"""A campaign along the corridor: its point models, global model and held-out conditions, and their errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.blend.global_model import GlobalModel
from freqid.core.arrays import Array
from freqid.core.results.design import MultisineDesign
from freqid.core.results.fit import Fit
from freqid.core.results.judged.doubt import Doubt, doubts_of
from freqid.core.results.judged.truth import KnownTruth, Miss, as_many_as_by_chance
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.core.viewable import Viewable
from freqid.identify.in_flight.parameter_history import ParameterHistory

GOOD_R2 = 0.95
MOST_VALIDATION = 1.15
"""Error of prediction over error of fit that is still called alike; above, a risk of use."""
FAILED_VALIDATION = 2.0
"""Error of prediction over error of fit above which a model is not used."""
MOST_HELD_OUT = 1.25
"""Error of the global model over that of a point model, where neither was made from the manoeuvre."""
MOST_NEW_DENSITY = 1.5
"""The same at an air density that the global model was not made at."""


@dataclass(frozen=True, eq=False)
class StudiedPoint:
    """One reference condition: what was identified there, and how it compares.

    Attributes
    ----------
    model : PointModel
        Its ``prediction`` holds a manoeuvre that was not used.
    linear : mapping of str to mapping of str to float
        Derivatives of the linearised simulation by response and regressor, in the units of the
        parameters; empty for real flights.
    history : mapping of str to ParameterHistory
        By response, over the manoeuvre that was used; empty where none was kept.
    validation_time : ndarray, shape (k,)
        Length of the manoeuvre used, s.
    validation_rmse : mapping of str to ndarray, shape (k,)
        By response, in its unit: rms of the error when the model made from that length predicts the
        manoeuvre that was not used.
    repeated : mapping of str to float
        By response: probability of a larger chi-square between the parameters of this model and those of the
        manoeuvre that was not used, were the two alike; empty where they were not compared.
    truth : mapping of str to KnownTruth
        By response: what flights without noise tell of the linearisation; empty for real flights.
    """

    model: PointModel
    linear: Mapping[str, Mapping[str, float]]
    history: Mapping[str, ParameterHistory]
    validation_time: Array
    validation_rmse: Mapping[str, Array]
    repeated: Mapping[str, float] = field(default_factory=dict)
    truth: Mapping[str, KnownTruth] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """Of the reference condition."""
        return self.model.reference.id

    def modelling_rmse(self, response: str) -> float:
        """Return `rmse_inside` of the manoeuvre that the model was made from.

        In time, as predictions are compared; on the lines where the model holds no history.
        """
        found = self.model[response]
        return rmse_inside(found.fit["time"], self._highest(response)) if "time" in found.fit else found.rmse

    def prediction_rmse(self, response: str) -> float:
        """Return `rmse_inside` of the manoeuvre that was not used, nan where nothing was predicted."""
        fit = self.model.prediction.get(response)
        return float("nan") if fit is None else rmse_inside(fit, self._highest(response))

    def validation_ratio(self, response: str) -> float:
        """Return the error of prediction over that of the fit, nan where either is missing or zero."""
        fitted = self.modelling_rmse(response)
        return self.prediction_rmse(response) / fitted if fitted > 0 else float("nan")

    def _highest(self, response: str) -> float:
        fit = self.model[response].fit
        return float(fit["frequency"].axis[-1]) if "frequency" in fit else float("inf")

    def from_linear(self, response: str) -> Array:
        """Return estimates less the linearised simulation's, in standard errors, shape (p,).

        nan where the simulation was not linearised.
        """
        found, known = self.model[response], self.linear.get(response, {})
        truth = np.array([known.get(name, np.nan) for name in found.regressors])
        with np.errstate(divide="ignore", invalid="ignore"):
            return (found.estimate - truth) / found.std_error

    def misses(self, response: str) -> tuple[Miss, ...]:
        """Return the parameters that are off the truth, with what each misses and why; farthest first."""
        known = self.truth.get(response)
        found = self.model[response]
        if known is None or known.regressors != found.regressors:
            return ()
        return known.misses(found.estimate, found.std_error)

    def doubts(self, response: str, *, noise_is_chance: bool = False) -> tuple[Doubt, ...]:
        """Return the parameters that cannot be trusted as numbers, and why; those that matter most first.

        Parameters
        ----------
        response : str
        noise_is_chance : bool
            Whether a parameter that is off by noise alone is no doubt: see `doubts_of_points`.
        """
        misses = [m for m in self.misses(response) if not (noise_is_chance and m.by_noise_alone)]
        return doubts_of(self.model[response], misses)

    def from_noise_free(self, response: str) -> Array:
        """Return estimates less those of the same flight without noise, in standard errors, shape (p,).

        nan where the flight was not flown without noise.
        """
        known, found = self.truth.get(response), self.model[response]
        if known is None or known.regressors != found.regressors:
            return np.full(len(found.regressors), np.nan)
        return known.from_noise_free(found.estimate, found.std_error)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A manoeuvre at a condition that the global model was not made from.

    Attributes
    ----------
    reference : Reference
        Where it was flown.
    global_rmse, point_rmse : mapping of str to float
        By response, in its unit: rms of the error of the global model, and of a point model that was
        identified there.
    """

    reference: Reference
    global_rmse: Mapping[str, float]
    point_rmse: Mapping[str, float]

    def ratio(self, response: str) -> float:
        """Return the global model's error over the point model's, nan where either is missing or zero."""
        point = self.point_rmse.get(response, 0.0)
        return self.global_rmse.get(response, float("nan")) / point if point else float("nan")


@dataclass(frozen=True, eq=False)
class StudyResults(Viewable):
    """The whole chain of a scenario.

    Attributes
    ----------
    vehicle : Vehicle
    sensors : str
        Suite of the scenario; empty for real flights.
    noise : float
        Multiple of the suite's noise; nan for real flights.
    estimator : {"least-squares", "instruments"}
        Of the point models.
    design : MultisineDesign, optional
        The inputs of the manoeuvres that were modelled, where they are known.
    points : tuple of StudiedPoint
        One or more, all with the same responses; held-out conditions may be among them.
    model : GlobalModel, optional
    held_out : tuple of HeldOut
    provenance : mapping
        What the study was made from, for the page.
    own_designs : mapping of str to MultisineDesign
        By condition: the inputs of those that state an excitation of their own, flown there in place of
        `design`.
    """

    vehicle: Vehicle
    sensors: str
    noise: float
    estimator: str
    design: MultisineDesign | None
    points: tuple[StudiedPoint, ...]
    model: GlobalModel | None = None
    held_out: tuple[HeldOut, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    own_designs: Mapping[str, MultisineDesign] = field(default_factory=dict)

    def __repr__(self) -> str:
        flown = f"noise {self.noise:g} times {self.sensors}" if self.sensors else "real flights"
        count = len(self.points)
        return f"<StudyResults of {self.vehicle.name!r}: {count} conditions, {self.estimator}, {flown}>"

    @property
    def responses(self) -> tuple[str, ...]:
        """Names, in the order of the first model."""
        return tuple(self.points[0].model.responses)

    @property
    def form(self) -> str:
        """Of the responses: ``"force"``, ``"specific"`` or ``"coefficient"``."""
        return self.points[0].model.form

    def followed(self) -> list[StudiedPoint]:
        """Return up to three points to show in detail, by ascending speed.

        Of those with a history, or of all where none has one, as `spanning_conditions` takes them.
        """
        points = [p for p in self.points if p.history] or self.points
        return [points[i] for i in spanning_conditions([p.model.reference for p in points])]


def noise_is_chance(points: Sequence[StudiedPoint]) -> bool:
    """Return whether no more parameters are off the noise-free estimates than noise alone would leave."""
    away = np.concatenate([np.zeros(0), *(p.from_noise_free(r) for p in points for r in p.model.responses)])
    return as_many_as_by_chance(away[np.isfinite(away)])


def doubts_of_points(points: Sequence[StudiedPoint]) -> tuple[tuple[StudiedPoint, Doubt], ...]:
    """Return the parameters of all points that cannot be trusted as numbers, each with its point.

    One that is off by noise alone is none of them where all that are off by noise are as many as chance
    leaves: its interval says as much as it can.
    """
    chance = noise_is_chance(points)
    return tuple(
        (p, d) for p in points for r in p.model.responses for d in p.doubts(r, noise_is_chance=chance)
    )


def left_to_noise(points: Sequence[StudiedPoint]) -> int:
    """Return how many parameters are off by noise alone and for that reason not in `doubts_of_points`."""
    if not noise_is_chance(points):
        return 0
    return sum(m.by_noise_alone for p in points for r in p.model.responses for m in p.misses(r))


def causes_of(points: Sequence[StudiedPoint]) -> Counter[str]:
    """Return how many parameters are off the linearised simulation, by the computed cause."""
    every = (m for p in points for r in p.model.responses for m in p.misses(r))
    return Counter(m.cause for m in every if m.of != "noise-free estimate")


def most_allowed(results: StudyResults, held_out: HeldOut) -> float:
    """Return what a held-out ratio may be: more where no point of the global model has that density."""
    model, rho = results.model, held_out.reference.rho
    known = model is None or any(same_density(rho, at) for at in model.corridor.rho.tolist())
    return MOST_HELD_OUT if known else MOST_NEW_DENSITY


def rmse_inside(fit: Fit, highest_hz: float = float("inf")) -> float:
    """Return the rms of a history's residual about its mean, without the ends of the history.

    Parameters
    ----------
    fit : Fit
        Real, in time, uniform.
    highest_hz : float
        Of what the history holds; infinite where it holds all.
    """
    return float(np.std(fit.inside(highest_hz).residual))


def spanning_conditions(references: Sequence[Reference]) -> list[int]:
    """Return which of some conditions stand for all: up to three, by ascending speed.

    The slowest, the middle and the fastest at the densest air, so that speed alone tells them apart; of
    all where fewer than three are there.
    """
    dense = distinct_densities(at.rho for at in references)[0]
    among = [i for i, at in enumerate(references) if same_density(at.rho, dense)]
    if len(among) < 3:
        among = list(range(len(references)))
    among.sort(key=lambda i: references[i].u)
    return [among[k] for k in dict.fromkeys((0, len(among) // 2, len(among) - 1))]


def distinct_densities(rhos: Iterable[float]) -> list[float]:
    """Return densities, the densest first; those within 2 % are one. kg/m3."""
    levels: list[float] = []
    for rho in sorted(rhos, reverse=True):
        if not any(same_density(rho, level) for level in levels):
            levels.append(rho)
    return levels


def same_density(rho: float, level: float) -> bool:
    """Say whether two densities are one; unknown ones are."""
    return not abs(rho - level) > 0.02 * level
