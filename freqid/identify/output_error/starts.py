"""Starts of a model's parameters by equation error: the equations themselves, with measured states put in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import all_names, numbered
from freqid.identify.output_error.simulation import Compiled, delayed, derivative_of, output_of
from freqid.identify.spectra.smoothing import local_derivative

ROUNDS = 3  # of least squares, for equations that are not linear in their parameters
WINDOW, DEGREE = 9, 4  # samples and degree of the polynomials that differentiate states
SMALL = 1e-6  # relative change of parameters that ends the rounds
FAINT = 1e-8  # singular value of unit columns, relative to the largest, that moves no parameter


@lru_cache(maxsize=32)
def _compiled(model: DynamicModel) -> Compiled:
    derivative, output = derivative_of(model), output_of(model)
    others = jnp.array([i for i, n in enumerate(model.outputs) if n not in model.states], dtype=int)

    def predict(p: jax.Array, x: jax.Array, u: jax.Array, dt: float) -> jax.Array:
        u = delayed(model, p, u, dt)
        rates = jax.vmap(derivative, (0, 0, None))(x, u, p)
        seen = jax.vmap(output, (0, 0, None))(x, u, p)[:, others]
        return jnp.concatenate((rates, seen), axis=1)

    return jax.jit(lambda p, x, u, dt: (predict(p, x, u, dt), jax.jacfwd(predict)(p, x, u, dt)))


def equation_error_starts(
    model: DynamicModel, signals: Sequence[Signals], given: Mapping[str, float], fixed: Mapping[str, float]
) -> dict[str, float]:
    """Return starts of all numbers of a problem.

    Parameters
    ----------
    model : DynamicModel
    signals : sequence of Signals
    given : mapping of str to float
        Starts that the user gives, by parameter; they are kept.
    fixed : mapping of str to float
        Values that the others are estimated beside.

    Raises
    ------
    UsageError
        Where a state is not measured and not every parameter is given.

    Notes
    -----
    Derivatives of measured states, and outputs that are no states, are regressed on the equations'
    derivatives by the parameters; every equation is weighed by its own rms. Parameters that the equations do
    not tell keep their start, zero where none is given.
    """
    count = len(signals)
    names = all_names(model, count)
    values = dict.fromkeys(names, 0.0)
    for i, s in enumerate(signals):
        values |= {
            numbered(f"x0_{x}", i, count): float(s.outputs[x][0]) for x in model.states if x in s.outputs
        }
    known = {**given, **fixed}
    for name, value in known.items():
        values |= {n: float(value) for n in names if n == name or n.startswith(f"{name}@")}
    wanted = [p for p in model.parameters if p not in known]
    if not wanted:
        return values
    hidden = [x for x in model.states if x not in model.outputs]
    if hidden:
        raise UsageError(
            f"equation error gives no start for {' '.join(wanted)} of model '{model.name}', whose "
            f"{'state' if len(hidden) == 1 else 'states'} {' '.join(hidden)} are not measured",
            remedy="give start values of these parameters",
        )
    full = np.array([values[n] for n in names])
    free = [j for j, n in enumerate(names) if not n.startswith("x0_") and n.partition("@")[0] in wanted]
    for _ in range(ROUNDS):
        rows, columns = [], []
        for i, s in enumerate(signals):
            place = [names.index(n if n in model.shared else numbered(n, i, count)) for n in model.parameters]
            z, jacobian = _equations(model, s, full[place])
            wide = np.zeros((len(z), len(names)))
            wide[:, place] = jacobian
            rows.append(z)
            columns.append(wide[:, free])
        step = _solve(np.concatenate(columns), np.concatenate(rows))
        full[free] += step
        if (np.abs(step) <= SMALL * np.abs(full[free])).all():
            break
    return dict(zip(names, map(float, full), strict=True))


def _equations(model: DynamicModel, s: Signals, p: Array) -> tuple[Array, Array]:
    """Return what the equations leave and their derivatives by the parameters, each equation weighed."""
    x = np.array([s.outputs[n] for n in model.states]).reshape(len(model.states), s.samples)
    window = min(WINDOW, s.samples - 1 + s.samples % 2)
    rates = local_derivative(x, s.dt, window, min(DEGREE, window - 1)) if len(x) else x
    others = [s.outputs[n] for n in model.outputs if n not in model.states]
    measured = np.concatenate((rates, np.array(others).reshape(len(others), s.samples))).T
    predicted, along = (np.asarray(v) for v in _compiled(model)(p, x.T, s.input_matrix(model), s.dt))
    size = measured.std(axis=0)
    weight = 1 / np.where(size > 0, size, 1.0)
    return (
        ((measured - predicted) * weight).ravel(),
        (along * weight[None, :, None]).reshape(-1, len(model.parameters)),
    )


def _solve(columns: Array, z: Array) -> Array:
    size = np.sqrt((columns**2).sum(axis=0))
    told = size > 0
    step = np.zeros(size.size)
    step[told] = np.linalg.lstsq(columns[:, told] / size[told], z, rcond=FAINT)[0] / size[told]
    return step
