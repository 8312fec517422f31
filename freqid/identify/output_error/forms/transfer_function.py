"""One output from one input by a ratio of polynomials, with a delay where wanted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.identify.output_error.model import DynamicModel, Named, Signals
from freqid.identify.regress.regression import LeastSquares, least_squares
from freqid.identify.spectra.fourier import FourierPlan
from freqid.identify.spectra.trend import TrendKind, remove_trend


@lru_cache(maxsize=32)
def transfer_function(
    output: str, input_: str, numerator: int, denominator: int, *, delay: bool = False, bias: bool = False
) -> DynamicModel:
    """Return ``output = exp(-s tau) (b_m s^m + ... + b_0) / (s^n + a_n-1 s^n-1 + ... + a_0) input``.

    Parameters
    ----------
    output, input_ : str
    numerator, denominator : int
        Orders m and n, m at most n + 1: of the input's second derivative nothing is known.
    delay, bias : bool
        Whether ``tau``, s, and a bias of the output are parameters too.

    Returns
    -------
    DynamicModel
        With parameters ``b0`` to ``bm``, ``a0`` to ``an-1``; states ``eta0`` and so on are not measured.

    Raises
    ------
    UsageError
        For other orders.
    """
    m, n = numerator, denominator
    if n < 1 or not 0 <= m <= n + 1:
        raise UsageError(
            f"orders of numerator and denominator are {m} and {n}, expected a denominator of order one or "
            "more and a numerator of at most one order more"
        )
    states = tuple(f"eta{i}" for i in range(n))
    rate = f"{input_}_rate"
    improper = m == n + 1

    def equations(x: Named, u: Named, p: Named) -> tuple[Named, Named]:
        below = [p[f"a{i}"] for i in range(n)] + [1.0]
        above = [p[f"b{i}"] for i in range(m + 1)] + [0.0] * (n + 1 - m)
        seen = 0.0
        for order, acting in ((1, u.get(rate, 0.0)), (0, u[input_])):  # polynomial division, highest first
            share = above[n + order]
            above = [a - share * below[i - order] if 0 <= i - order <= n else a for i, a in enumerate(above)]
            seen = seen + share * acting
        for i in range(n):
            seen = seen + above[i] * x[f"eta{i}"]
        rates = {f"eta{i}": x[f"eta{i + 1}"] for i in range(n - 1)}
        rates[f"eta{n - 1}"] = u[input_] - sum(below[i] * x[f"eta{i}"] for i in range(n))
        return rates, {output: seen + p.get(f"bias_{output}", 0.0)}

    inputs = (input_, rate) if improper else (input_,)
    return DynamicModel(
        f"{output} from {input_}, order {m} over {n}",
        states,
        inputs,
        (output,),
        (
            *(f"b{i}" for i in range(m + 1)),
            *(f"a{i}" for i in range(n)),
            *(("tau",) if delay else ()),
            *((f"bias_{output}",) if bias else ()),
        ),
        equations,
        own=(f"bias_{output}",) if bias else (),
        delays=dict.fromkeys(inputs, "tau") if delay else {},
        rates={rate: input_} if improper else {},
        units={"tau": "s"},
    )


def fit_on_lines(
    output: str,
    input_: str,
    numerator: int,
    denominator: int,
    signals: Sequence[Signals],
    lines_hz: Array,
    trend: TrendKind = "line",
    delay_s: float = 0.0,
) -> LeastSquares:
    """Return equation error of a transfer function: what output error starts from.

    Parameters
    ----------
    output, input_, numerator, denominator
        As `transfer_function`.
    signals : sequence of Signals
    lines_hz : ndarray, shape (M,)
    trend : {"endpoints", "line", "mean", "none"}
    delay_s : float
        Known or guessed, taken out of the input.

    Notes
    -----
    ``(jw)^n y = sum b_i (jw)^i u - sum a_i (jw)^i y``, complex least squares (Klein & Morelli, ch. 7).
    """
    columns, responses = [], []
    for s in signals:
        plan = FourierPlan(s.samples, s.dt, lines_hz)
        histories = np.array([np.asarray(s.inputs[input_]), s.outputs[output]])
        u, y = plan(remove_trend(histories, s.dt, trend).x)
        u = u * np.exp(-2j * np.pi * lines_hz * delay_s)
        jw = 2j * np.pi * lines_hz
        columns.append([u * jw**i for i in range(numerator + 1)] + [-y * jw**i for i in range(denominator)])
        responses.append(y * jw**denominator)
    names = (*(f"b{i}" for i in range(numerator + 1)), *(f"a{i}" for i in range(denominator)))
    return least_squares(
        np.concatenate([np.array(c) for c in columns], axis=1), np.concatenate(responses)[None], names=names
    )
