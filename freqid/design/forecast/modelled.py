"""An aircraft as a point model has it: what that says about a design before it is flown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from freqid.core.errors import UsageError
from freqid.core.excitation import Excitation
from freqid.core.identification import Identification
from freqid.core.results.design import MultisineDesign
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.closed_loop import STATES, ClosedLoop
from freqid.design.forecast.limits import room
from freqid.design.forecast.optimal import Optimum, optimal_amplitudes
from freqid.design.forecast.perturbation_model import close_loop, derivatives_of, drawn_derivatives
from freqid.design.forecast.shortest import shortest
from freqid.design.forecast.standard_errors import Forecast, forecast

VARIED_MODELS = 12  # drawn from the model's covariance, for the spread of what is expected
ABORT_SHARE = 0.5  # of an abort limit that an expected peak may reach, where nobody says how much
Criterion = Literal["A", "D"]
Wanted = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class ModelledAircraft:
    """A point model in its control loop, with the noise of its sensors.

    Attributes
    ----------
    point : PointModel
    loop : ClosedLoop
    varied : tuple of ClosedLoop
        Those of models as far off as the model's covariance lets them be.
    trim : mapping of str to float
        Positions of the effectors that the model states, SI.
    settings : Identification, optional
    noise : mapping of str to float
        One sigma by channel; by effector where the scenario has it by kind.
    """

    point: PointModel
    loop: ClosedLoop
    varied: tuple[ClosedLoop, ...]
    trim: Mapping[str, float]
    settings: Identification | None
    noise: Mapping[str, float]

    @classmethod
    def of(cls, point: PointModel, scenario: Scenario, seed: int = 0) -> ModelledAircraft:
        """Close the loop of a scenario around a point model.

        Raises
        ------
        UsageError
            Where the model is not of forces in body axes, or the loop is not stable.
        """
        vehicle = scenario.aircraft()
        trim = {
            name: float(value)
            for response in point.responses.values()
            for name, value in zip(response.regressors, response.trim, strict=True)
            if name in vehicle.effector_kinds
        }

        def closed(derivatives: Wanted) -> ClosedLoop:
            gains = scenario.control.get("gains")
            return close_loop(derivatives, vehicle, u=point.reference.u, gains=gains, trim=trim)

        varied = []
        for derivatives in drawn_derivatives(point, VARIED_MODELS, seed):
            try:
                varied.append(closed(derivatives))
            except UsageError:  # a draw that is unstable says that the spread is at least this wide
                continue
        noise = dict(scenario.noise)
        for effector in vehicle.effectors:
            if effector.kind in noise:
                noise.setdefault(effector.name, noise[effector.kind])
        return cls(point, closed(derivatives_of(point)), tuple(varied), trim, scenario.identification, noise)

    def forecast(self, design: MultisineDesign) -> Forecast | None:
        """Return what a flight of the design will buy; None where noise or [identification] is not stated."""
        if self.settings is None or not self.noise:
            return None
        return forecast(design, self.loop, self.settings, self.noise)

    def shortest(self, design: MultisineDesign, wanted: Wanted, longest_s: float) -> MultisineDesign:
        """Return the design with the fewest periods that reach wanted standard errors; see `shortest`."""
        settings = self._identified()
        return shortest(design, self.loop, settings, self.noise, wanted, longest_s=longest_s).design

    def optimal(
        self,
        design: MultisineDesign,
        excitation: Excitation,
        criterion: Criterion,
        wanted: Wanted | None = None,
    ) -> Optimum:
        """Return the best amplitudes inside the limits of effectors, rates and excursions.

        Parameters
        ----------
        design : MultisineDesign
        excitation : Excitation
            Its `excursions` are kept, and half of the `abort` limits of states without one.
        criterion, wanted
            As for `optimal_amplitudes`.
        """
        settings, vehicle = self._identified(), self.loop.vehicle
        allowed, rates = room(vehicle, design.names, about(vehicle, self.trim))
        allowed |= {x: ABORT_SHARE * limit for x, limit in excitation.abort.items() if x in STATES}
        allowed |= excitation.excursions
        return optimal_amplitudes(
            design, self.loop, settings, self.noise, allowed, rates, criterion=criterion, wanted=wanted
        )

    def _identified(self) -> Identification:
        if self.settings is None:
            raise UsageError(
                "section [identification] is missing, so that no accuracy can be aimed at", remedy="add it"
            )
        return self.settings


def about(vehicle: Vehicle, trim: Mapping[str, float]) -> dict[str, float]:
    """Return a position of every effector: of its trim, or the middle of its limits where that is unknown."""
    return {e.name: trim.get(e.name, sum(e.limits) / 2) for e in vehicle.effectors}
