"""The global model: the wrench and its gradient anywhere along the corridor, at any density."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.blend.line import BlendedResponse, Line
from freqid.blend.locate import CorridorTolerance, Located, Outside, between, locate
from freqid.blend.similarity import equivalent, goes_with_velocity
from freqid.blend.state_space import StateSpace, check_loads, trimmed, vehicle_of
from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.results.corridor import Corridor
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.core.viewable import Viewable


class Mixed:
    """A response as a sum over lines of ``[bias, derivatives]`` times factors.

    Parameters
    ----------
    response : sequence of BlendedResponse
        By line.
    at : Located

    Attributes
    ----------
    factors : ndarray, shape (line, 1 + p, n)
    columns : list of int, length p
        Rows of ``Located.x`` that the response depends on.

    Notes
    -----
    With weights 1 - c and c of two lines at trims x0 and x0 + d, the response at regressors x is

    ``z = (1 - c) z_1(x) + c z_2(x) + c (1 - c) / 2 (theta_2 - theta_1) d``

    The two tangents' mean lies off a curved load by ``c (1 - c) / 2 d^T F'' d``, and ``F'' d`` is the
    difference of the derivatives: the last term, with which z is right to the second order in d.
    """

    def __init__(self, response: Sequence[BlendedResponse], at: Located):
        self._response, self._at = response, at
        self.columns = response[0].columns
        x = at.x[self.columns]
        places = list(zip(response, at.positions, strict=True))
        trim = np.array([one.trim(p.s) for one, p in places])
        self._parameters = np.array([one.parameters(p.s) for one, p in places])
        self._off, self._gap = x - trim, np.diff(trim, axis=0)
        self._bend = np.diff(self._parameters[:, 1:], axis=0)
        w = at.weights[:, None]
        self._curving = 0.5 * w[:-1] * w[1:]
        self.factors = np.concatenate([w, _propagated(w * self._off, -self._curving * self._gap)], axis=1)

    @property
    def value(self) -> Array:
        """The response, shape (n,)."""
        return np.einsum("lji,lji->i", self._parameters, self.factors)

    @property
    def variance(self) -> Array:
        """Its variance from the errors at the knots, shape (n,)."""
        places = zip(self._response, self._at.positions, self.factors, strict=True)
        return np.sum([one.variance(p.s, f) for one, p, f in places], axis=0)

    @property
    def by_regressor(self) -> Array:
        """Derivative with respect to the response's equivalent regressors, shape (p, n)."""
        return np.einsum("li,lji->ji", self._at.weights, self._parameters[:, 1:])

    @property
    def by_place(self) -> Array:
        """Derivative with respect to the place on each line, regressors held, shape (line, n)."""
        places = list(zip(self._response, self._at.positions, strict=True))
        changing = np.array([one.parameters(p.s, 1) for one, p in places]) * self.factors
        moving = np.array([one.trim(p.s, 1) for one, p in places])
        weighted = self._at.weights[:, None] * self._parameters[:, 1:]
        moving *= _propagated(weighted, self._curving * self._bend)
        return changing.sum(axis=1) - moving.sum(axis=1)

    @property
    def by_weight(self) -> Array:
        """Derivative with respect to density through the lines' weights alone, shape (n,)."""
        w, slope = self._at.weights[:, None], self._at.slopes[:, None]
        tangents = self._parameters[:, :1] + (self._parameters[:, 1:] * self._off).sum(axis=1, keepdims=True)
        curving = 0.5 * (slope[:-1] * w[1:] + w[:-1] * slope[1:])
        return (slope * tangents).sum(axis=(0, 1)) + (curving * self._bend * self._gap).sum(axis=(0, 1))


def _propagated(by_line: Array, gain: Array) -> Array:
    """Return values by line where each gained something from the next, shape (line, p, n)."""
    by_line = by_line.copy()
    by_line[:-1] += gain
    by_line[1:] -= gain
    return by_line


@dataclass(frozen=True)
class BlendedWrench:
    """Responses of a global model.

    Attributes
    ----------
    names, units : tuple of str
        Of the responses.
    values : ndarray, shape (response, n)
    outside : ndarray of bool, shape (n,)
        Where the corridor is too far away: parameters are then held at its nearest point.
    mixed : tuple of Mixed
        What the values are made of, by response.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    outside: NDArray[np.bool_]
    mixed: tuple[Mixed, ...] = field(repr=False)

    def __repr__(self) -> str:
        rows = ", ".join(
            f"{name} {np.array2string(value, precision=4)} {unit}"
            for name, value, unit in zip(self.names, self.values, self.units, strict=True)
        )
        return f"<BlendedWrench {rows}>"

    @cached_property
    def std_error(self) -> Array:
        """Standard errors from those of the point models, shape (response, n)."""
        return np.sqrt([one.variance for one in self.mixed])


@dataclass(frozen=True)
class BlendedParameters:
    """Bias and derivatives of one response along the corridor.

    Attributes
    ----------
    names : tuple of str, length 1 + p
        ``"bias"`` and the regressors.
    estimate, std_error : ndarray, shape (1 + p, n)
        Unit of the response, and that per unit of the regressor, at the density asked for.
    """

    names: tuple[str, ...]
    estimate: Array
    std_error: Array


class GlobalModel(Viewable):
    """One model of the applied wrench over the transition corridor, from point models along it.

    Parameters
    ----------
    corridor : Corridor
        The point models, lined up.
    tolerance : Tolerance, optional
        How far from the corridor it may be used.

    Notes
    -----
    On each line of the corridor every parameter is a shape-preserving cubic of equivalent speed, and the
    wrench is the blended trim wrench plus blended derivatives times the distance from the blended trim.
    Between lines of different density it is linear in density; beyond the outermost lines density acts
    through similarity alone (docs/theory/global-model.md).

    Inputs are a mapping of names to arrays of shape (n,), SI: all regressors of the model, ``u`` and
    ``rho``, and the scheduled variables, such as tilts, that differ along the corridor. A number stands for
    all n.
    """

    def __init__(self, corridor: Corridor, tolerance: CorridorTolerance | None = None):
        self.corridor, self.tolerance = corridor, tolerance or CorridorTolerance()
        self.lines = [
            Line(corridor, np.flatnonzero(corridor.line == i)) for i in range(corridor.line.max() + 1)
        ]
        self._velocity = goes_with_velocity(corridor.units)[:, None]
        moves = np.ptp(corridor.schedule, axis=1) > 0
        self._moving = tuple(name for name, moved in zip(corridor.scheduled, moves, strict=True) if moved)

    def __repr__(self) -> str:
        c = self.corridor
        return (
            f"<GlobalModel of {c.vehicle!r}: {' '.join(self.names)} over {len(c.ids)} conditions, "
            f"u {c.u.min():.4g} to {c.u.max():.4g} m/s, rho {c.rho.min():.4g} to {c.rho.max():.4g} kg/m3>"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Responses, in the order of all results."""
        return tuple(self.corridor.responses)

    @property
    def inputs(self) -> tuple[str, ...]:
        """What the model must be given, in the order of the gradient."""
        return tuple(dict.fromkeys([*self.corridor.units, "u", *self._moving, "rho"]))

    def wrench(
        self, inputs: Mapping[str, ArrayLike] | None = None, outside: Outside = "refuse", **values: ArrayLike
    ) -> BlendedWrench:
        """Return the responses for vectors of states, effectors, tilts and densities.

        Parameters
        ----------
        inputs : mapping of str to array_like, shape (n,), optional
            All that the model needs, SI.
        outside : {"refuse", "hold"}
            What to do too far from the corridor: raise, or hold the nearest parameters and say so.
        **values : array_like, shape (n,)
            In place of `inputs`, SI: ``u``, and what else is not at the corridor's own trim there; ``rho``
            too where the corridor has lines of several densities.

        Raises
        ------
        DataError
            Outside, where that is refused; for values that are not finite.
        UsageError
            Where an input is missing or unknown.

        Examples
        --------
        >>> aircraft.wrench(u=30.0, de1=0.05).values  # doctest: +SKIP
        """
        at = self._locate(inputs if inputs is not None else self._about_trim(values), outside)
        mixed = self._mixed(at)
        units = tuple(r.unit for r in self.corridor.responses.values())
        return BlendedWrench(self.names, units, np.array([one.value for one in mixed]), at.outside, mixed)

    def gradient(self, inputs: Mapping[str, ArrayLike], outside: Outside = "refuse") -> Array:
        """Return the derivatives of the responses with respect to `inputs`.

        Parameters
        ----------
        inputs, outside
            As for `wrench`.

        Returns
        -------
        ndarray, shape (response, input, n)
            In the order of ``GlobalModel.inputs``: exact derivatives of what `wrench` returns.
        """
        at = self._locate(inputs, outside)
        place = {name: i for i, name in enumerate(self.inputs)}  # regressors first
        result = np.zeros((len(self.names), len(place), at.rho.size))
        by_speed = np.array([p.by_speed for p in at.positions])
        by_schedule = np.array([p.by_schedule for p in at.positions])
        velocity = self._velocity * at.x
        for row, mixed in zip(result, self._mixed(at), strict=True):
            by_x, by_place, own = mixed.by_regressor, mixed.by_place, mixed.columns
            speed = (by_place * by_speed).sum(axis=0)
            row[own] = by_x * at.scale[own]
            row[place["u"]] += speed * at.k
            for i, name in enumerate(self.corridor.scheduled):
                if name in place:
                    row[place[name]] += (by_place * by_schedule[:, i]).sum(axis=0)
            moved = (by_x * velocity[own]).sum(axis=0) + speed * at.u * at.k
            row[place["rho"]] += moved / (2 * at.rho) + mixed.by_weight
        return result

    def reference(self, along: ArrayLike, rho: ArrayLike) -> dict[str, Array]:
        """Return the inputs at the corridor's own trim, for plots and linear models.

        Parameters
        ----------
        along, rho : array_like, shape (n,)
            True speed, m/s, or the variable that the corridor runs along, SI, and density, kg/m3.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            Tilts and regressors that the point models are expanded about, blended. Between two lines the
            same true speed is taken on both; beyond them the same equivalent speed.

        Raises
        ------
        DataError
            Where that is outside the corridor.
        """
        c = self.corridor
        by_speed = c.along == "u"
        place, rho = np.broadcast_arrays(np.atleast_1d(np.asarray(along, float)), np.asarray(rho, float))
        k, weights = equivalent(rho), between(self.lines, rho)[0]
        nearest = np.clip(rho, self.lines[0].rho, self.lines[-1].rho)
        x, schedule = np.zeros((len(c.units), place.size)), np.zeros((len(c.scheduled), place.size))
        speed = np.zeros(place.size)
        for line, w in zip(self.lines, weights, strict=True):
            s = place * k * np.sqrt(line.rho / nearest) if by_speed else place
            edge = 1e-9 * np.ptp(line.knots)
            outside = (w > 0) & ((s < line.knots[0] - edge) | (s > line.knots[-1] + edge))
            if outside.any():
                ends = line.knots / equivalent(line.rho) if by_speed else line.knots
                unit = "m/s" if by_speed else c.scheduled_units[c.scheduled.index(c.along)]
                raise DataError(
                    f"{c.along} = {place[outside][0]:.4g} {unit} is outside the corridor, which runs from "
                    f"{ends[0]:.4g} to {ends[-1]:.4g} {unit} at {line.rho:.4g} kg/m3"
                )
            s = np.clip(s, line.knots[0], line.knots[-1])
            x, schedule = x + w * line.trim(s, len(x)), schedule + w * line.schedule(s)
            speed += w * line.speed(s)
        u = place if by_speed else speed / k
        found = dict(zip(c.units, x / k**self._velocity, strict=True))
        return {**dict(zip(c.scheduled, schedule, strict=True)), "u": u, "rho": rho, **found}

    def parameters(
        self, response: str, inputs: Mapping[str, ArrayLike], outside: Outside = "refuse"
    ) -> BlendedParameters:
        """Return bias and derivatives of one response, with standard errors.

        Parameters
        ----------
        response : str
        inputs, outside
            As for `wrench`; of the inputs only ``u``, ``rho`` and the tilts matter, so those that
            `reference` returns will do.
        """
        knots = self.corridor[response]
        at = self._locate({**dict.fromkeys(self.corridor.units, 0.0), **inputs}, outside)
        index = self.names.index(response)
        units = dict(zip(knots.regressors, knots.regressor_units, strict=True))
        scale = np.vstack([np.ones_like(at.k), at.k ** goes_with_velocity(units)[:, None]])
        estimate, variance = np.zeros_like(scale), np.zeros_like(scale)
        for line, p, w in zip(self.lines, at.positions, at.weights, strict=True):
            one = line.local[index]
            estimate += w * one.parameters(p.s)
            variance += w**2 * one.own_variance(p.s)
        return BlendedParameters(("bias", *knots.regressors), estimate * scale, np.sqrt(variance) * scale)

    def parameter_covariance(self, response: str, inputs: Mapping[str, ArrayLike]) -> Array:
        """Return the covariance of a response's derivatives at one place, shape (p, p).

        Parameters
        ----------
        response : str
        inputs : mapping of str to float
            As for `parameters`, of one place.

        Notes
        -----
        Of the derivatives at a fixed place on the corridor: what its error adds to a derivative with respect
        to speed, which moves along the corridor, is left out.
        """
        at = self._locate({**dict.fromkeys(self.corridor.units, 0.0), **inputs}, "refuse")
        index, knots = self.names.index(response), self.corridor[response]
        units = dict(zip(knots.regressors, knots.regressor_units, strict=True))
        scale = (at.k ** goes_with_velocity(units)[:, None])[:, 0]
        found = np.zeros((scale.size, scale.size))
        for line, p, w in zip(self.lines, at.positions, at.weights[:, 0], strict=True):
            by_knot = line.local[index].parameters.weights(p.s)[1:, :, 0]  # (p, knot)
            own = line.local[index].covariance[:, 1:, 1:]
            found += w**2 * np.einsum("ik,kij,jk->ij", by_knot, own, by_knot)
        return found * np.outer(scale, scale)

    def to_statespace(self, reference: Reference, vehicle: Vehicle | None = None) -> StateSpace:
        """Linearise the aircraft's motion about a condition, identified or not.

        Parameters
        ----------
        reference : Reference
            Its speed and density; the trim there, tilts included, is the model's own.
        vehicle : Vehicle, optional
            Mass properties and rotors, in place of those that the points were identified with.

        Returns
        -------
        StateSpace

        Raises
        ------
        UsageError
            Where the model lacks a response, is not one of forces and moments, or nobody states the mass.
        DataError
            Where the speed is outside the corridor.

        Notes
        -----
        The pitch angle is that at which the blended trim wrench carries the weight, ``tan(theta) = X / -Z``.
        """
        return self.to_statespaces([reference], vehicle)[0]

    def to_statespaces(
        self, references: Sequence[Reference], vehicle: Vehicle | None = None
    ) -> list[StateSpace]:
        """Return `to_statespace` of several `references`, of one `vehicle`, faster than one by one."""
        check_loads(self.names, self.corridor.form)
        described = vehicle_of(vehicle, self.corridor.aircraft)
        along = self.corridor.along
        inputs = self.reference(
            [r.u if along == "u" else r[along] for r in references], [r.rho for r in references]
        )
        rows = [self.names.index(r) for r in WRENCH]
        gradient = dict(zip(self.inputs, self.gradient(inputs)[rows].swapaxes(0, 1), strict=True))
        loads = self.wrench(inputs).values[rows]
        return [
            trimmed(
                {n: gradient[n][:, i] for n in self.corridor.units},
                loads[:, i],
                {name: float(value[i]) for name, value in inputs.items()},
                described,
            )
            for i in range(len(references))
        ]

    def drawn(self, count: int, seed: int = 0) -> list[GlobalModel]:
        """Return models as far from this one as its points' covariances let them be.

        Parameters
        ----------
        count : int
        seed : int
            Of the random numbers.

        Raises
        ------
        UsageError
            Where the points state no covariance.
        """
        return [GlobalModel(corridor, self.tolerance) for corridor in self.corridor.drawn(count, seed)]

    def to_control(
        self,
        *,
        draws: int = 0,
        seed: int = 0,
        outputs: Sequence[str] = (),
        vehicle: Vehicle | None = None,
        **at: float,
    ) -> Any:
        """Return the aircraft's small motion about a condition as a python-control ``StateSpace``.

        Parameters
        ----------
        draws : int
            How many models to draw from the covariance; the estimate alone where zero.
        seed : int
            Of the draws.
        outputs : sequence of str
            Among u v w p q r phi theta, psi, alt, V, alpha and beta; the eight states where empty.
        vehicle : Vehicle, optional
            Mass properties and rotors, in place of those that the points were identified with.
        **at : float
            ``u``, m/s (or what else the corridor runs along, SI), and ``rho``, kg/m3, where the corridor has
            lines of several densities: the one at sea level where absent.

        Returns
        -------
        control.StateSpace, or a list of `draws` of them
            States u v w (m/s) p q r (rad/s) phi theta (rad), inputs the effectors in SI (rad, or rad/s of
            rotors), all from the trim. Names are its labels: ``aircraft.to_control(u=30.0)["q", "de1"]``.

        Raises
        ------
        DataError
            Where the condition is outside the corridor, or python-control is not installed: it is the extra
            ``control``.
        UsageError
            Where the condition is not given, or the model states no covariance to draw from.

        Examples
        --------
        >>> aircraft.to_control(u=30.0).poles()  # doctest: +SKIP
        """
        along = self.corridor.along
        for name in at:
            if name not in (along, "rho"):
                raise UsageError(
                    f"a condition is set by {along} and rho, not by '{name}'", remedy=f"give {along} alone"
                )
        if along not in at:
            self._about_trim({})  # says so
        rho = at.get("rho", self.lines[-1].rho)
        place = {along: at[along]} if along != "u" else {}
        condition = Reference.of("", at.get("u", float("nan")), rho, **place)
        models = self.drawn(draws, seed) if draws else [self]
        spaces = [model.to_statespace(condition, vehicle).to_control(outputs) for model in models]
        return spaces if draws else spaces[0]

    def _about_trim(self, values: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
        """Return all inputs: those given, and the corridor's own trim for the others."""
        for name in values:
            if name not in self.inputs:
                raise UsageError(f"the model has no input '{name}'", remedy=nearest(name, self.inputs))
        along = self.corridor.along
        if along not in values:
            what = "the speed u is not given, m/s" if along == "u" else f"{along} is not given, SI"
            raise UsageError(what, remedy=f"give it, such as {along}={self._first_along():.4g}")
        if "rho" not in values and len(self.lines) > 1:
            raise UsageError(
                "the corridor has lines of several densities and rho is not given, kg/m3",
                remedy=f"give it, such as rho={self.lines[-1].rho:.4g}",
            )
        trim = self.reference(values[along], values.get("rho", self.lines[0].rho))
        return {**{name: trim[name] for name in self.inputs}, **values}

    def _first_along(self) -> float:
        """Return a value of the variable that the corridor runs along."""
        return 30.0 if self.corridor.along == "u" else float(self.lines[0].knots[0])

    def _mixed(self, at: Located) -> tuple[Mixed, ...]:
        return tuple(Mixed([line.local[r] for line in self.lines], at) for r in range(len(self.names)))

    def _locate(self, inputs: Mapping[str, ArrayLike], outside: Outside) -> Located:
        return locate(self.corridor, self.lines, inputs, self.inputs, self.tolerance, outside)
