"""Transfer functions and state-space models, delays among their parameters, fitted to frequency responses.

References
----------
M. B. Tischler, R. K. Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., AIAA, 2012, ch. 11
(transfer functions), ch. 12 and 13 (state space, insensitivities and Cramer-Rao bounds from the Hessian).
C. K. Sanathanan, J. Koerner, "Transfer Function Synthesis as a Ratio of Two Complex Polynomials", IEEE Trans.
Automatic Control 8, 1963 (where transfer functions start from).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.results.frequency_response import FittedResponse, FrequencyResponse
from freqid.identify.output_error.forms.transfer_function import transfer_function
from freqid.identify.output_error.frequency_domain import responses_of
from freqid.identify.output_error.minimise import Minimum, Point, minimise, unexcited
from freqid.identify.output_error.model import DynamicModel
from freqid.identify.output_error.simulation import derivative_of

SMALLEST_ERROR = 1e-3
"""Of a response's magnitude: what is left of smoothing, where the random error is less."""

DELAYS_S = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3)
"""Delays that a transfer function's fit starts from; the best end wins."""

_AT_THE_SENSOR = ("state/ax", "state/ay", "state/az")
_TURNS = 12  # of the weighted linear fit that each starts with


def fit_transfer_function(
    response: FrequencyResponse,
    output: str,
    input_: str,
    numerator: int,
    denominator: int,
    *,
    delay: bool = True,
    band_hz: tuple[float, float] | None = None,
) -> FittedResponse:
    """Fit ``exp(-s tau) (b_m s^m + ... + b_0) / (s^n + ... + a_0)`` to one output's response to one input.

    Parameters
    ----------
    response : FrequencyResponse
    output, input_ : str
    numerator, denominator : int
        Orders m and n, m at most n + 1.
    delay : bool
        Whether ``tau``, s, is a parameter.
    band_hz : tuple of 2 floats, optional
        All known frequencies where absent.

    Raises
    ------
    UsageError
        For unknown names or orders that cannot be.
    DataError
        Where there are fewer frequencies than parameters, or no fit is found.
    """
    one = response.of((input_,), (output,))
    model = transfer_function(output, input_, numerator, denominator, delay=delay)
    points = _Points(model, one, band_hz)
    if points.independent < len(model.parameters) / 2 + 1:
        raise DataError(
            f"{points.independent:.3g} independent frequencies do not determine {len(model.parameters)} "
            f"parameters of order {numerator} over {denominator}",
            remedy="lower the orders, or widen the band",
        )
    best: Minimum | None = None
    found: tuple[Array, Minimum] | None = None
    for tau in DELAYS_S if delay else (0.0,):
        start = _weighted_linear(points, numerator, denominator, tau)
        start = np.concatenate([start, [max(tau, 0.01)]]) if delay else start
        end = _minimised(points, start, model.parameters, {"tau": (0.0, np.inf)})
        if end is not None and (best is None or end.point.cost < best.point.cost):
            best, found = end, (start, end)
    if found is None:
        raise DataError(
            f"no fit of order {numerator} over {denominator} converges for {output} to {input_}",
            remedy="try other orders",
        )
    return _fitted(points, f"{output} to {input_}, order {numerator} over {denominator}", *found)


def fit_model(
    response: FrequencyResponse,
    model: DynamicModel,
    about: Mapping[str, float],
    *,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    band_hz: tuple[float, float] | None = None,
) -> FittedResponse:
    """Fit the parameters of a dynamic model to all responses that it has in common with those measured.

    Parameters
    ----------
    response : FrequencyResponse
    model : DynamicModel
        A ready form, or any other. Own parameters, as biases, do not enter and are left out.
    about : mapping of str to float
        Values of the model's states and inputs that it is linearised about, constants of the vehicle among
        them.
    start : mapping of str to float, optional
        By parameter; others start from least squares on the state equations, for which all states have to be
        among the outputs of the response. Delays start from 0.05 s.
    fixed : mapping of str to float, optional
        Parameters that are not estimated. Those that act on nothing measured are held at zero.
    band_hz : tuple of 2 floats, optional

    Raises
    ------
    UsageError
        Where response and model have no output or input in common, or a parameter is unknown or has no start.
    DataError
        Where no fit is found, or the responses do not determine a parameter.
    """
    start, fixed = dict(start or {}), dict(fixed or {})
    for name in (*start, *fixed):
        if name not in model.shared:
            raise UsageError(
                f"model '{model.name}' has no parameter '{name}' that responses tell",
                remedy=nearest(name, model.shared),
            )
    inputs = tuple(n for n in response.inputs if n in model.inputs)
    # accelerations of a model are those of the centre of gravity, a channel's those of its sensor
    outputs = tuple(n for n in response.outputs if _bare(n) in model.outputs and n not in _AT_THE_SENSOR)
    if not inputs or not outputs:
        raise UsageError(
            f"the responses of {', '.join(response.outputs)} to {', '.join(response.inputs)} and model "
            f"'{model.name}' have no {'inputs' if outputs else 'outputs'} in common",
            remedy=f"estimate those of {', '.join(model.outputs)}",
        )
    points = _Points(model, response.of(inputs, outputs), band_hz, about)
    free = [p for p in model.shared if p not in fixed]
    missing = [p for p in free if p not in start and p not in model.delays.values()]
    start |= {p: 0.05 for p in free if p not in start and p in model.delays.values()}
    if missing:
        found = _state_equations(points, missing, {**start, **fixed})
        start |= found
        fixed |= {p: 0.0 for p in missing if p not in found}
        free = [p for p in free if p not in fixed]
    values = np.array([start[p] for p in free])
    points = points.held(fixed, free)
    end = _minimised(points, values, free, dict.fromkeys(model.delays.values(), (0.0, np.inf)))
    if end is None:
        raise DataError(f"no fit of model '{model.name}' converges", remedy="give other starts")
    return _fitted(points, model.name, values, end)


def _bare(name: str) -> str:
    return name.rpartition("/")[2]


@lru_cache(maxsize=32)
def _compiled(model: DynamicModel) -> Any:
    """Return ``both(vector, inputs, omega, x, u)``: responses, shape (n, k, M), and their derivatives."""
    responses = responses_of(model)

    def every(vector: jax.Array, *given: jax.Array) -> jax.Array:
        inputs, omega, x, u = given
        return jax.vmap(lambda one: responses(vector, one, omega, x, u))(inputs)

    def both(vector: jax.Array, *given: jax.Array) -> tuple[jax.Array, jax.Array]:
        def pushed(tangent: jax.Array) -> tuple[jax.Array, jax.Array]:
            return jax.jvp(lambda v: every(v, *given), (vector,), (tangent,))

        return jax.vmap(pushed, out_axes=(None, -1))(jnp.eye(vector.size, dtype=vector.dtype))

    return jax.jit(both)


class _Points:
    """Measured responses beside a model's, in units of their errors."""

    def __init__(
        self,
        model: DynamicModel,
        response: FrequencyResponse,
        band_hz: tuple[float, float] | None,
        about: Mapping[str, float] | None = None,
    ):
        about = about or {}
        self.model, self.response = model, response
        f = response.frequencies_hz
        low, high = band_hz or (0.0, np.inf)
        error = np.hypot(response.std_error, SMALLEST_ERROR * np.abs(response.value))
        share = np.ones(f.size) if response.independent is None else response.independent
        known = np.isfinite(response.value) & np.isfinite(error) & (error > 0) & (f >= low) & (f <= high)
        if not known.any():
            raise DataError(f"no response is known between {low:g} and {high:g} Hz", remedy="widen the band")
        with np.errstate(invalid="ignore", divide="ignore"):
            self.weight = np.where(known, np.sqrt(share) / error, 0.0)
        self.measured = np.where(known, response.value, 0.0)
        self.independent = float(np.sum(known * share))
        self.band_hz = (float(f[known.any(axis=(0, 1))][0]), float(f[known.any(axis=(0, 1))][-1]))
        omega = 2 * np.pi * f
        self._rows = [model.outputs.index(_bare(n)) for n in response.outputs]
        inputs = np.zeros((len(response.inputs), len(model.inputs), f.size), dtype=complex)
        for one, name in zip(inputs, response.inputs, strict=True):
            one[model.inputs.index(name)] = 1.0
            for rate, of in model.rates.items():
                if of == name:
                    one[model.inputs.index(rate)] = 1j * omega
        self.inputs, self.omega = inputs, omega
        self._x = np.array([about.get(n, 0.0) for n in model.states])
        self._u = np.array([about.get(n, 0.0) for n in model.inputs])
        self._vector = np.zeros(len(model.parameters) + len(model.states))
        self.free = list(range(len(model.parameters)))

    def held(self, fixed: Mapping[str, float], free: Sequence[str]) -> _Points:
        """Hold some parameters, and say which are free."""
        for name, value in fixed.items():
            self._vector[self.model.parameters.index(name)] = value
        self.free = [self.model.parameters.index(n) for n in free]
        return self

    @property
    def about(self) -> tuple[Array, Array]:
        return self._x, self._u

    def modelled(self, values: Array) -> tuple[Complex, Complex]:
        """Return responses, shape (o, n, M), and their derivatives by the free parameters, (o, n, M, p)."""
        vector = self._vector.copy()
        vector[self.free] = values
        found, along = _compiled(self.model)(vector, self.inputs, self.omega, self._x, self._u)
        found, along = np.asarray(found), np.asarray(along)
        return (
            found.transpose(1, 0, 2)[self._rows],
            along.transpose(1, 0, 2, 3)[self._rows][..., self.free],
        )


def _minimised(
    points: _Points, start: Array, names: Sequence[str], bounds: Mapping[str, tuple[float, float]]
) -> Minimum | None:
    """Minimise half the squared error in units of the random error, over numbers in units of the start."""
    scale = np.where(start == 0, 1.0, np.abs(start))

    def cost(free: Array) -> float:
        left = points.weight * (points.modelled(free * scale)[0] - points.measured)
        total = float(0.5 * np.sum(np.abs(left) ** 2))
        return total if np.isfinite(total) else np.inf

    def linearise(free: Array) -> Point:
        value, along = points.modelled(free * scale)
        left = (points.weight * (value - points.measured)).ravel()
        columns = (points.weight[..., None] * along * scale).reshape(left.size, -1)
        total = float(0.5 * np.sum(np.abs(left) ** 2))
        if not np.isfinite(total):
            return Point(np.inf, np.zeros(free.size), np.zeros((free.size, free.size)))
        return Point(total, (columns.conj().T @ left).real, (columns.conj().T @ columns).real)

    limits = [bounds.get(n, (-np.inf, np.inf)) for n in names]
    lower, upper = (np.array([b[i] for b in limits]) / scale for i in (0, 1))
    return minimise(cost, linearise, start / scale, lower, upper)


def _fitted(points: _Points, name: str, start: Array, end: Minimum) -> FittedResponse:
    scale = np.where(start == 0, 1.0, np.abs(start))
    names = [points.model.parameters[i] for i in points.free]
    hold, others = unexcited(end.point.information)
    if hold:
        twins = ", ".join(names[k] for k in others[hold[0]])
        raise DataError(
            f"the responses do not determine '{names[hold[0]]}'"
            + (f" apart from {twins}" if twins else ", which has no influence"),
            remedy="fix it, lower the orders, or widen the band",
        )
    value = points.modelled(end.free * scale)[0]
    # of two parts to each complex number; above one the model leaves more than the random error
    left = end.point.cost / max(points.independent - end.free.size / 2, 1.0)
    inflated = np.sqrt(max(left, 1.0))
    information = end.point.information
    units = points.model.units
    response = points.response
    return FittedResponse(
        name=name,
        outputs=response.outputs,
        inputs=response.inputs,
        parameters=tuple(names),
        units=tuple(units.get(n, "") for n in names),
        estimate=end.free * scale,
        cramer_rao=inflated * np.sqrt(np.diag(np.linalg.inv(information))) * scale,
        insensitivity=inflated / np.sqrt(np.diag(information)) * scale,
        value=value,
        cost=float("nan"),
        weighted_error=left,
        band_hz=points.band_hz,
    )


def _weighted_linear(points: _Points, numerator: int, denominator: int, delay_s: float) -> Array:
    """Return ``b_0 .. b_m, a_0 .. a_n-1`` by linear least squares, weighted anew by the last denominator."""
    s = 1j * points.omega
    weight, g = points.weight[0, 0], points.measured[0, 0] * np.exp(s * delay_s)
    middle = float(np.exp(np.mean(np.log(points.omega[weight > 0]))))
    z = s / middle  # of size one, for the condition
    columns = np.array([z**i for i in range(numerator + 1)] + [-g * z**i for i in range(denominator)])
    below = np.ones(s.size, dtype=complex)
    found = np.zeros(len(columns))
    for _ in range(_TURNS):
        w = weight / np.abs(below)
        a, b = (columns * w).T, g * z**denominator * w
        found = np.linalg.lstsq(
            np.concatenate([a.real, a.imag]), np.concatenate([b.real, b.imag]), rcond=None
        )[0]
        below = z**denominator + sum(found[numerator + 1 + i] * z**i for i in range(denominator))
    powers = np.concatenate([np.arange(numerator + 1), np.arange(denominator)])
    return found * middle ** (denominator - powers)


def _state_equations(points: _Points, wanted: Sequence[str], known: Mapping[str, float]) -> dict[str, float]:
    """Return starts by least squares on ``jw X = A X + B U``, in which the parameters are linear.

    Those that act on nothing measured are left out.
    """
    model = points.model
    places = {_bare(n): i for i, n in enumerate(points.response.outputs)}
    lost = [s for s in model.states if s not in places]
    if lost:
        raise UsageError(
            f"'{wanted[0]}' has no start: state '{lost[0]}' is no output of the responses",
            remedy="estimate the response of all states, or give the start of every parameter",
        )
    derivative = derivative_of(model)
    x, u = points.about
    states = points.measured[[places[s] for s in model.states]]  # (state, input, M)
    late = np.array([known.get(model.delays.get(n, ""), 0.0) for n in model.inputs])
    acting = points.inputs * np.exp(-1j * points.omega * late[:, None])

    def left(parameters: Array) -> Complex:
        a, b = (np.asarray(j) for j in jax.jacfwd(derivative, (0, 1))(x, u, parameters))
        through = np.einsum("ij,jnm->inm", a, states) + np.einsum("ij,njm->inm", b, acting)
        return 1j * points.omega * states - through

    weight = points.weight[[places[s] for s in model.states]] / np.maximum(points.omega, 1e-9)
    base = np.array([known.get(p, 0.0) for p in model.parameters])
    at = [model.parameters.index(p) for p in wanted]
    nothing = left(base)
    columns = np.array([(weight * (nothing - left(base + row))).ravel() for row in np.eye(base.size)[at]]).T
    right = (weight * nothing).ravel()
    size = np.linalg.norm(columns, axis=0)
    acts = size > 0
    columns = columns[:, acts] / size[acts]
    found = np.linalg.lstsq(
        np.concatenate([columns.real, columns.imag]), np.concatenate([right.real, right.imag]), rcond=None
    )[0]
    names = [p for p, yes in zip(wanted, acts, strict=True) if yes]
    return dict(zip(names, (found / size[acts]).tolist(), strict=True))
