"""How well a gap could be seen: covariance of the stack, detectability of an effect, and an ideal scan.

The covariance of the stack is that of the sensors' noise, by Monte Carlo, plus that of everything within the
stated tolerances: to first order by differences of flights, and what is beyond it by flights with all of them
drawn together. The noise is so low that the latter alone has a detectability of some hundreds. An ideal scan
knows every effect's true shape; its threshold is that of other such flights.

An effect of what a tolerance is stated for differs from its first order by the second, and by its own form (a
surface that loses more at large deflections); this remainder alone reaches a stratum at three sigmas. It is
no gap: detectability is bounded by the squared number of sigmas, and the scan sees no more of it than that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sensing
from candidates import Candidate, stated
from motion import fly
from multisine import harmonics
from numpy.typing import NDArray
from scatter import added, draw, per_case, per_flight
from scipy.linalg import solve_triangular
from scipy.special import logsumexp
from settings import Settings
from stack import LINES, rows_of, stack

DRAWS = 100  # of the sensors' noise, for each condition
SCATTERED = 200  # draws of all tolerances for the covariance, and as many for the scan's threshold
BATCH = 1000  # flights integrated together: 1 GB with twelve effectors; numpy costs the same for fewer
STRATA = (15.0, 50.0, 200.0, 1000.0)


def clean_stacks(
    aircraft: Any, simulation: Any, departures: list[dict[str, float]]
) -> NDArray[np.complex128]:
    """Return noise-free stacks, shape (case, condition, row, line), of flights by the first design."""
    conditions = list(aircraft.TRIM)
    made = flown_stacks(aircraft, simulation, [(c, d) for d in departures for c in conditions])
    return made.reshape(len(departures), len(conditions), *made[0].shape)


def flown_stacks(
    aircraft: Any, simulation: Any, wanted: list[tuple[str, dict[str, float]]]
) -> NDArray[np.complex128]:
    """Return noise-free stacks, shape (flight, row, line), of flights by the first design.

    Parameters
    ----------
    aircraft, simulation : module
    wanted : list of (str, dict)
        Condition and departures of each flight.
    """
    flights = [({"condition": c, "design": 0}, d) for c, d in wanted]
    out = []
    for start in range(0, len(flights), BATCH):
        part = flights[start : start + BATCH]
        with np.errstate(all="ignore"):
            log = fly(aircraft, [f for f, _ in part], Settings([d for _, d in part]))
        for k, (flight, d) in enumerate(part):
            if not np.abs(log.state[:, 6:8, k]).max() < 1.0:  # lost control, or no longer finite
                out.append(np.full((len(rows_of(aircraft)), LINES.size), np.nan + 0j))
                continue
            channels = sensing.measure(aircraft, log, k, d, None)
            out.append(stack(aircraft, simulation, channels, aircraft.TRIM[flight["condition"]]["rho"]))
    return np.array(out)


@dataclass
class Metric:
    """Noise and tolerances of the mean stack of two repeats.

    Attributes
    ----------
    rows : list of str
    bias : ndarray, shape (condition, row, line)
        Mean of the nominal truth's stack with noise: errors of form and of replaying on noisy motion.
    nominal : ndarray, shape (condition, row, line)
        The nominal truth's stack without noise.
    factor : ndarray, shape (condition, line, row, row)
        Cholesky factors of the noise covariance.
    tolerance : ndarray, shape (number, column)
        Whitened change that one sigma of each tolerance makes; then columns whose outer products are the
        covariance of what all of them make beyond first order.
    beyond_first : ndarray, shape (number,)
        Whitened mean of the latter.
    scattered : ndarray, shape (draw, number)
        Whitened change that other draws of all tolerances make.
    """

    rows: list[str]
    bias: NDArray[np.complex128]
    nominal: NDArray[np.complex128]
    factor: NDArray[np.complex128]
    tolerance: NDArray[np.float64]
    beyond_first: NDArray[np.float64]
    scattered: NDArray[np.float64]

    def __post_init__(self) -> None:
        t = self.tolerance
        self._solve = np.linalg.inv(np.eye(t.shape[1]) + t.T @ t) if t.size else None

    def whiten(self, change: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return a stack of shape (condition, row, line) as independent numbers of unit variance."""
        parts = []
        for c in range(change.shape[0]):
            for k in range(change.shape[2]):
                z = solve_triangular(self.factor[c, k], change[c, :, k], lower=True, check_finite=False)
                parts.append(np.real(z) if k == 0 else np.sqrt(2) * np.concatenate([z.real, z.imag]))
        return np.concatenate(parts)

    def weighed(self, white: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the inverse of the whole covariance times whitened columns."""
        t = self.tolerance
        return white - t @ (self._solve @ (t.T @ white))

    def shares(self, aircraft: Any, change: NDArray[np.complex128]) -> dict[str, dict[str, float]]:
        """Return shares of detectability by row and by the effector whose lines carry it."""
        white = self.whiten(change)
        y = self.weighed(white)
        owner = {int(k): name for name, own in harmonics(aircraft.SCENARIO).items() for k in own}
        by_row, by_input = np.zeros(len(self.rows)), {}
        at, n = 0, len(self.rows)
        for c in range(change.shape[0]):
            for k in range(change.shape[2]):
                if k == 0:
                    z, at = y[at : at + n].astype(complex), at + n
                else:
                    z, at = (y[at : at + n] + 1j * y[at + n : at + 2 * n]) * np.sqrt(2), at + 2 * n
                back = solve_triangular(self.factor[c, k].conj().T, z, lower=False)
                part = np.real(np.conj(change[c, :, k]) * back)
                by_row += part
                name = owner.get(k, "steady" if k == 0 else "none")
                by_input[name] = by_input.get(name, 0.0) + float(part.sum())
        return {
            "rows": _shares(dict(zip(self.rows, by_row.tolist(), strict=True))),
            "inputs": _shares(by_input),
        }


def _shares(parts: dict[str, float]) -> dict[str, float]:
    """Return positive parts over their sum, without those below 0.1 %."""
    total = sum(max(v, 0.0) for v in parts.values()) or 1.0
    return {k: round(v / total, 4) for k, v in parts.items() if v > 1e-3 * total}


def metric(aircraft: Any, simulation: Any, seed: int = 1) -> Metric:
    """Return the covariance of the stack about the nominal truth."""
    conditions = list(aircraft.TRIM)
    log = fly(aircraft, [{"condition": c, "design": 0} for c in conditions], Settings([{}] * len(conditions)))
    rng = np.random.default_rng(seed)
    nominal, bias, factor = [], [], []
    for c, name in enumerate(conditions):
        rho = aircraft.TRIM[name]["rho"]

        def once(draws, c=c, rho=rho):
            return stack(aircraft, simulation, sensing.measure(aircraft, log, c, {}, draws), rho)

        nominal.append(once(None))
        drawn = np.array([once(rng) for _ in range(DRAWS)])
        bias.append(drawn.mean(axis=0))
        off = (drawn - bias[-1]) * np.sqrt(DRAWS / (DRAWS - 1))
        per_line = []
        for k in LINES:
            near = [0] if k == 0 else list(range(max(1, k - 3), min(LINES[-1], k + 3) + 1))
            cover = sum(off[:, :, j].T @ off[:, :, j].conj() for j in near) / (DRAWS * len(near))
            if k == 0:
                cover = np.real(cover) * (1 + len(cover) / DRAWS)
            per_line.append(np.linalg.cholesky(0.5 * cover))  # of the mean of two repeats
        factor.append(np.array(per_line))
    size = (2 * LINES.size - 1) * len(rows_of(aircraft)) * len(conditions)
    nothing = np.zeros((size, 0)), np.zeros(size), np.zeros((0, size))
    out = Metric(rows_of(aircraft), np.array(bias), np.array(nominal), np.array(factor), *nothing)
    cases, flights = per_case(aircraft), per_flight(aircraft)
    names = [*cases, *flights]
    sigma = cases | flights
    stacks = clean_stacks(aircraft, simulation, [{n: sigma[n]} for n in names])
    columns = []
    for name, made in zip(names, stacks, strict=True):
        change = made - out.nominal
        if name in cases:
            columns.append(out.whiten(change))
        else:  # the mean of two flights' own biases, for each condition apart
            for c in range(len(conditions)):
                alone = np.zeros_like(change)
                alone[c] = change[c]
                columns.append(out.whiten(alone) / np.sqrt(2))
    first = np.array(columns).T
    sigmas, made = scattered(aircraft, simulation, out, 2 * SCATTERED, rng)
    beyond = (made - sigmas @ first.T)[:SCATTERED]
    mean = beyond.mean(axis=0)
    second = (beyond - mean).T / np.sqrt(SCATTERED - 1)
    every = np.hstack([first, second])
    return Metric(out.rows, out.bias, out.nominal, out.factor, every, mean, made[SCATTERED:])


def scattered(
    aircraft: Any, simulation: Any, m: Metric, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fly draws of all tolerances together, as a case without an effect has them.

    Returns
    -------
    sigmas : ndarray, shape (draw, column)
        In the order of the metric's columns of first order.
    made : ndarray, shape (draw, number)
        Whitened change of the mean stack of two repeats.
    """
    cases, flights = per_case(aircraft), per_flight(aircraft)
    sigmas, wanted = [], []
    for _ in range(count):
        common = draw(cases, rng)
        own = {c: [draw(flights, rng) for _ in range(2)] for c in aircraft.TRIM}
        wanted += [(c, added(common, own[c][repeat])) for repeat in range(2) for c in aircraft.TRIM]
        sigmas.append([common[name] / sigma for name, sigma in cases.items()])
        for name, sigma in flights.items():
            sigmas[-1] += [(a[name] + b[name]) / np.sqrt(2) / sigma for a, b in own.values()]
    made = flown_stacks(aircraft, simulation, wanted)
    made = made.reshape(count, 2, *m.nominal.shape).mean(axis=1) - m.nominal
    return np.array(sigmas), np.array([m.whiten(change) for change in made])


@dataclass
class Signatures:
    """True shapes of effects at sizes that have a given detectability.

    Attributes
    ----------
    candidates : list of Candidate
    size : ndarray, shape (candidate, stratum)
        NaN where the stratum lies beyond the physical range.
    detectability : ndarray, shape (candidate, stratum)
        At most the squared number of sigmas of what is stated for the same thing.
    column : ndarray, shape (candidate, stratum, number)
        Whitened; zero where there is no size.
    shares : list of list of dict
        By candidate and stratum, where detectability lies.
    """

    candidates: list[Candidate]
    size: NDArray[np.float64]
    detectability: NDArray[np.float64]
    column: NDArray[np.float64]
    shares: list[list[dict[str, dict[str, float]]]]

    def beyond(self, m: Metric) -> NDArray[np.float64]:
        """Return the columns, less strong where a tolerance for the same thing bounds detectability."""
        power = np.einsum("ijn,ijn->ij", self.column, np.array([m.weighed(c.T).T for c in self.column]))
        seen = np.divide(self.detectability, power, out=np.zeros_like(power), where=power > 0)
        return self.column * np.sqrt(seen)[..., None]


def sigmas_of(aircraft: Any, c: Candidate) -> float:
    """Return how many sigmas of the tolerances for the same thing a unit of size is; infinite without any."""
    cases, flights = per_case(aircraft), per_flight(aircraft)
    squares = 0.0
    for name, unit in stated(aircraft, c).items():
        if name in cases:
            squares += (unit / cases[name]) ** 2
        elif name in flights:  # the mean of two flights, in each condition
            squares += 2 * len(aircraft.TRIM) * (unit / flights[name]) ** 2
    return np.sqrt(squares) or np.inf


def signatures(
    aircraft: Any, simulation: Any, m: Metric, listed: list[Candidate], points: int = 7
) -> Signatures:
    """Find the size of every effect that reaches each stratum within 10 %."""
    sigmas = np.array([sigmas_of(aircraft, c) for c in listed])

    def weigh(pairs):
        made = (
            clean_stacks(aircraft, simulation, [{listed[i].key: listed[i].sign * size} for i, size in pairs])
            - m.nominal
        )
        white = np.array([m.whiten(change) for change in made])
        power = np.einsum("ij,ij->i", white, m.weighed(white.T).T)
        power = np.minimum(power, [(size * sigmas[i]) ** 2 for i, size in pairs])
        return made, white, power

    grid = np.array([np.geomspace(c.low, c.high, points) for c in listed])
    *_, power = weigh([(i, x) for i in range(len(listed)) for x in grid[i]])
    known = []
    for sizes, powers in zip(grid, power.reshape(grid.shape), strict=True):
        flown = np.isfinite(powers)
        known.append((np.log(sizes[flown]), np.log(np.maximum(powers[flown], 1e-12))))
    size = np.full((len(listed), len(STRATA)), np.nan)
    reached = np.zeros_like(size)
    column = np.zeros((*size.shape, m.tolerance.shape[0]))
    todo = [(i, j) for i in range(len(listed)) for j in range(len(STRATA))]
    shares: list[list[dict]] = [[{} for _ in STRATA] for _ in listed]
    for _ in range(8):
        pairs, cells = [], []
        for i, j in todo:
            x = _crossing(*known[i], np.log(STRATA[j]))
            if x is not None:
                pairs.append((i, float(np.exp(x))))
                cells.append((i, j))
        if not pairs:
            break
        made, white, power = weigh(pairs)
        todo = []
        for (i, x), (_, j), change, row, value in zip(pairs, cells, made, white, power, strict=True):
            if not np.isfinite(value):
                continue
            logs, levels = known[i]
            order = np.argsort([*logs, np.log(x)])
            known[i] = (
                np.array([*logs, np.log(x)])[order],
                np.array([*levels, np.log(max(value, 1e-12))])[order],
            )
            if abs(value / STRATA[j] - 1) <= 0.1:
                size[i, j], reached[i, j], column[i, j] = x, value, row
                shares[i][j] = m.shares(aircraft, change)
            else:
                todo.append((i, j))
    return Signatures(listed, size, reached, column, shares)


def _crossing(logs, levels, wanted):
    """Return where log detectability first passes a level; None outside the range."""
    for k in range(len(logs)):
        if levels[k] >= wanted:
            if k == 0:
                return logs[0] + 0.5 * (wanted - levels[0]) if wanted > levels[0] - 9 else None
            if levels[k] - levels[k - 1] > 6:  # a threshold, such as that of a limit of rate
                return 0.5 * (logs[k - 1] + logs[k])
            share = (wanted - levels[k - 1]) / (levels[k] - levels[k - 1])
            return logs[k - 1] + share * (logs[k] - logs[k - 1])
    return None


class IdealScan:
    """The best that could be done: every effect by its true shape at the strata's sizes.

    Parameters
    ----------
    m : Metric
    known : Signatures
    seed : int
    """

    def __init__(self, m: Metric, known: Signatures, seed: int = 2) -> None:
        keep = ~np.isnan(known.size)
        self.m, self.columns = m, known.beyond(m)[keep]
        index = np.broadcast_to(np.arange(len(known.candidates))[:, None], keep.shape)[keep]
        self.place = index
        self.signed = np.array([known.candidates[i].signed for i in index])
        self.ids = np.array([known.candidates[i].id for i in index])
        self.names = sorted(set(self.ids))
        self.weighed = m.weighed(self.columns.T).T
        G = self.weighed @ self.columns.T
        self.power = np.diag(G)
        values, vectors = np.linalg.eigh(self.weighed @ self.weighed.T)
        root = vectors * np.sqrt(np.maximum(values, 0))  # of the noise in what is weighed
        null = self.weighed @ (m.scattered - m.beyond_first).T
        noise = np.random.default_rng(seed).standard_normal((len(G), 20 * len(m.scattered)))
        draws = np.tile(null, 20) + root @ noise
        self.threshold = float(np.quantile(self.statistic(self.evidence(draws)), 0.98))

    def evidence(self, g: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log Bayes factor of every effect against none, shape (effect, ...)."""
        power = self.power.reshape(-1, *[1] * (g.ndim - 1))
        signed = self.signed.reshape(power.shape)
        one = g - power / 2
        each = np.where(signed, np.logaddexp(one, -g - power / 2) - np.log(2), one)
        out = []
        for name in self.names:
            places = []
            for i in np.unique(self.place[self.ids == name]):
                own = each[self.place == i]
                places.append(logsumexp(own, axis=0) - np.log(len(own)))
            out.append(logsumexp(places, axis=0) - np.log(len(places)))
        return np.array(out)

    @staticmethod
    def statistic(evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log Bayes factor of any effect against none."""
        return logsumexp(evidence, axis=0) - np.log(len(evidence))

    def judge(self, white: NDArray[np.float64], truth: list[str]) -> dict[str, Any]:
        """Return what the scan says of a mean stack.

        Parameters
        ----------
        white : ndarray, shape (number,)
            Whitened mean stack of the repeats, less that of the nominal truth and the mean of scatter.
        truth : list of str
            Ids that act.
        """
        chi2 = float(white @ self.m.weighed(white)) / white.size
        found = self.evidence(self.weighed @ white)
        statistic = float(self.statistic(found))
        share = np.exp(found - logsumexp(found))
        on_truth = float(sum(share[self.names.index(t)] for t in truth if t in self.names))
        best = self.names[int(np.argmax(found))]
        return {
            "found": statistic > self.threshold,
            "statistic": round(statistic, 2),
            "threshold": round(self.threshold, 2),
            "probability": round(on_truth, 4),
            "best": best,
            "chi2": round(chi2, 4),
        }
