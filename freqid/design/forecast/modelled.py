"""An aircraft as a point model has it: what that says about a design before it is flown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.closed_loop import STATES, PerturbedAircraft, index_of
from freqid.design.forecast.limits import effector_travel
from freqid.design.forecast.optimal import Optimum, optimal_amplitudes
from freqid.design.forecast.standard_errors import Forecast, forecast, shortest
from freqid.dynamics.small_motion import equations_of_motion, rotor_spin

# A mode that decays slower than this, 1/s, does not decay: an integrator that nothing closes.
NEUTRAL = 1e-9


def perturbed_aircraft(
    derivatives: Mapping[str, Mapping[str, float]],
    vehicle: Vehicle,
    *,
    u: float,
    w: float | None = None,
    theta: float = 0.0,
    gains: Mapping[str, Mapping[str, float]] | ArrayLike | None = None,
    lag_s: Mapping[str, float] | None = None,
    trim: Mapping[str, float] | None = None,
    gravity: float = STANDARD_GRAVITY,
) -> PerturbedAircraft:
    """Return the small-perturbation model of an aircraft about straight flight, wings level.

    Parameters
    ----------
    derivatives : mapping of str to mapping of str to float
        Of the applied wrench X Y Z L M N, by u v w p q r or effector, N and N m per SI unit; what is
        missing is zero. `derivatives_of` takes them from an identified model.
    vehicle : Vehicle
        Mass properties, effectors, rotors.
    u, w : float
        Reference velocity along x and z body, m/s; `w` is that of level flight, ``u tan(theta)``, where
        absent.
    theta : float
        Reference pitch angle, rad.
    gains : mapping or array_like of shape (n, 8), optional
        Commanded position per state, ``{"de": {"theta": 0.35, "q": 0.05}}``, or an array over effectors
        and u v w p q r phi theta; the injected signal is added to it. None flies without feedback.
    lag_s : mapping, optional
        Time constant of a first-order lag by effector, s; the others follow at once.
    trim : mapping, optional
        Effector positions at the reference: speeds of rotors with inertia, rad/s, and tilt angles, rad.
    gravity : float
        m/s2.

    Returns
    -------
    PerturbedAircraft

    Raises
    ------
    UsageError
        Where a name is unknown, or the closed loop has a mode that does not decay.

    Notes
    -----
    The motion is that of `freqid.dynamics.small_motion`, with ``h0 = S d0`` the rotors' momentum.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 3, linearised equations of motion.
    """
    names = tuple(effector.name for effector in vehicle.effectors)
    n = len(STATES) + len(names)
    wrench = np.zeros((6, n))
    columns = {name: j for j, name in enumerate((*STATES, *names)) if name not in ("phi", "theta")}
    for response, row in derivatives.items():
        i = index_of(response, WRENCH, "response")
        for regressor, value in row.items():
            index_of(regressor, tuple(columns), f"regressor of '{response}'")
            wrench[i, columns[regressor]] = value

    positions = dict(trim or {})
    for name in positions:
        index_of(name, names, "trimmed effector")
    spin = rotor_spin(vehicle, names, positions)
    momentum = spin @ np.array([positions.get(name, 0.0) for name in names])
    velocity = np.array([u, 0.0, u * np.tan(theta) if w is None else w])

    E, A, B = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, len(names)))
    E[:8], A[:8] = equations_of_motion(wrench, vehicle, velocity, theta, spin, momentum, gravity)
    for name, lag in (lag_s or {}).items():
        i = index_of(name, names, "effector with a lag")
        if not lag >= 0:
            raise UsageError(f"lag of '{name}' is {lag:g} s, expected zero or more")
        E[8 + i, 8 + i] = lag
    A[8:, :8], A[8:, 8:] = _feedback(gains, names), -np.eye(len(names))
    B[8:] = np.eye(len(names))
    loop = PerturbedAircraft(vehicle, E, A, B, wrench, velocity, spin, momentum)
    _refuse_unstable(loop)
    return loop


def derivatives_of(model: PointModel) -> dict[str, dict[str, float]]:
    """Return an identified model's derivatives as `perturbed_aircraft` wants them.

    Raises
    ------
    UsageError
        Where the model is not one of forces and moments in body axes.
    """
    if (model.form, model.axes) != ("force", "body"):
        raise UsageError(
            f"the model has the form '{model.form}' in {model.axes} axes, expected 'force' in body axes",
            remedy="identify it again with form 'force' and axes 'body'",
        )
    return {
        name: dict(zip(response.regressors, map(float, response.estimate), strict=True))
        for name, response in model.responses.items()
    }


def _feedback(gains: Mapping[str, Mapping[str, float]] | ArrayLike | None, names: tuple[str, ...]) -> Array:
    """Return gains as an array, shape (effector, state)."""
    shape = (len(names), len(STATES))
    if gains is None:
        return np.zeros(shape)
    if not isinstance(gains, Mapping):
        table = np.asarray(gains, dtype=float)
        if table.shape != shape:
            raise UsageError(f"gains have shape {table.shape}, expected {shape} for effectors and states")
        return table
    table = np.zeros(shape)
    for effector, row in gains.items():
        i = index_of(effector, names, "effector with gains")
        for state, gain in row.items():
            table[i, index_of(state, STATES, f"state fed back to '{effector}'")] = gain
    return table


def _refuse_unstable(loop: PerturbedAircraft) -> None:
    """Raise where a mode does not decay: then there is no steady state to forecast from."""
    values, participants = loop.modes()
    if not values.size or values[0].real < -NEUTRAL:
        return
    mode, where = values[0], " and ".join(participants[0])
    kind = "a motion"
    if abs(mode.imag) > NEUTRAL:
        kind = f"an oscillation of period {2 * np.pi / abs(mode.imag):.3g} s"
    grows = f"doubles in {np.log(2) / mode.real:.3g} s" if mode.real > NEUTRAL else "does not decay"
    raise UsageError(
        f"the closed loop is not stable: {kind} in {where} {grows}",
        remedy="give the gains that the aircraft flies with, or correct the derivatives",
    )


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
    loop : PerturbedAircraft
    varied : tuple of PerturbedAircraft
        Those of models as far off as the model's covariance lets them be.
    trim : mapping of str to float
        Positions of the effectors that the model states, SI.
    settings : Identification, optional
    noise : mapping of str to float
        One sigma by channel; by effector where the scenario has it by kind.
    """

    point: PointModel
    loop: PerturbedAircraft
    varied: tuple[PerturbedAircraft, ...]
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
        trim = positions_at(point.reference, vehicle) | {
            name: float(value)
            for response in point.responses.values()
            for name, value in zip(response.regressors, response.trim, strict=True)
            if name in vehicle.effector_kinds
        }

        def closed(derivatives: Wanted) -> PerturbedAircraft:
            gains = scenario.control.get("gains")
            return perturbed_aircraft(derivatives, vehicle, u=point.reference.u, gains=gains, trim=trim)

        varied = []
        for drawn in point.drawn(VARIED_MODELS, seed):
            try:
                varied.append(closed(derivatives_of(drawn)))
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
        allowed, rates = effector_travel(vehicle, design.names, about(vehicle, self.trim))
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


def positions_at(reference: Reference | None, vehicle: Vehicle) -> dict[str, float]:
    """Return the positions that a reference condition sets, by effector, SI; of an unknown one, none."""
    stated = reference.scheduled if reference else {}
    return {n: x for n, x in stated.items() if n in vehicle.effector_kinds and np.isfinite(x)}


def about(vehicle: Vehicle, trim: Mapping[str, float]) -> dict[str, float]:
    """Return a position of every effector: of its trim, or the middle of its limits where that is unknown."""
    return {e.name: trim.get(e.name, sum(e.limits) / 2) for e in vehicle.effectors}
