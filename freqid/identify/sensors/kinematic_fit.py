"""Output error on the kinematics of a rigid body: the sensor errors that best explain its channels."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, VELOCITY
from freqid.core.errors import DataError
from freqid.identify.regress.two_stage import LEAST_STRENGTH
from freqid.identify.sensors.kinematic_model import INITIAL, CompatibilityProblem, Guess, Prediction
from freqid.identify.sensors.path_noise import GustStrength, PathNoise, block_of, estimate_gusts, whiten
from freqid.identify.spectra.smoothing import smooth

# Half width of the window that smooths a residual's power, in units of 1/T: twice that of `uncertainty`,
# since what the filter has whitened varies less with frequency.
HALF_WIDTH = 4
# Least share of the equations around a line that the fit must leave free for its residual to tell anything.
FREE_SHARE = 0.25


def coloured_covariance(jacobian: Array, residual: Array) -> tuple[Array, Array]:
    """Return the covariance of least squares over several channels, each residual with its own colour.

    Parameters
    ----------
    jacobian : ndarray, shape (m, k, n)
        Derivatives of k whitened channels by m parameters.
    residual : ndarray, shape (k, n)
        What the fit leaves of the whitened channels.

    Returns
    -------
    covariance : ndarray, shape (m, m)
    degrees_of_freedom : ndarray, shape (m,)
        For Student's t.

    Notes
    -----
    ``sum_k D_k R_k D_k^T`` with D the weights of the estimate and R_k the Toeplitz matrix of a channel's
    autocovariance, taken on the lines of the padded transform with the residual's power smoothed over
    neighbouring lines. As in `uncertainty.correct_coloured_samples` the power that the parameters took is
    given back first, and degrees of freedom follow Satterthwaite.
    """
    m, k, n = jacobian.shape
    basis, factor = np.linalg.qr(jacobian.reshape(m, k * n).T)
    dual = np.linalg.solve(factor, basis.T).reshape(m, k, n)
    padded = next_fast_len(2 * n, real=True)
    share = n / padded  # independent lines per line
    width = 2 * round(HALF_WIDTH / share) + 1
    covariance, mean, scatter = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    for channel in range(k):
        weight = rfft(dual[:, channel], padded)
        weight[:, 1 : (padded + 1) // 2] *= np.sqrt(2)  # these stand for their mirror images too
        power = np.abs(rfft(residual[channel], padded)) ** 2 / n
        taken = (np.abs(rfft(basis.T.reshape(m, k, n)[:, channel], padded)) ** 2).sum(axis=0) / n
        free = np.maximum(uniform_filter1d(1 - taken, width, mode="mirror"), FREE_SHARE)
        spectrum = uniform_filter1d(power, width, mode="mirror") / free
        covariance += ((weight * spectrum) @ weight.conj().T).real / padded
        gain = np.abs(weight) ** 2 / padded
        mean += gain @ spectrum
        smooth = uniform_filter1d(gain / free, width, axis=1, mode="mirror")
        scatter += (smooth**2) @ (spectrum**2 * free) / share
    return covariance, np.maximum(2 * mean**2 / scatter - 2, 1.0)


Mask = NDArray[np.bool_]
_AIR = {n.partition("/")[2] for n in (*FLOW, *VELOCITY)}
_TINY = 1e-300
# How fast an aircraft rides a vertical gust, -Z_w/m, 1/s: 0.6 of an airliner, 3.3 of a drone of 28 kg/m2.
RIDING = 3.0
CALM = 1e-3  # m/s; gusts below move no sensor
MOST_WEIGHINGS = 3  # of the gusts, until the estimates have settled

# A parameter is held at zero where its standard error is beyond this share of the size that it may well have:
# the data then tell less about it than is known without them.
LARGEST_ERROR_SHARE = 0.5
# Nor is one believed that comes out this many plausible sizes away: a channel that shows noise and hardly
# any motion fits best with a scale of -1.
FARTHEST = 3.0
# Columns whose neighbours make up for them are kept apart from rounding by this much prior knowledge.
FAINT = 1e-3
HELD_STEPS = 3  # at least, and until they are small, before anything is judged
FULL_STEPS = 12  # after which half steps end the swinging of an unknown that is hardly observable
# Steps after which an unknown that still moves is held: the data tell it along a curve only, as the scale of
# an airspeed that a wind would explain as well, and Gauss-Newton creeps along that.
PATIENCE = 25
MOST_STEPS = 200
# Steps this small beside the standard errors let unknowns be judged, and end the iteration.
NEARLY, SETTLED = 0.5, 0.02
# Noise levels that change by less than this are steady.
STEADY = 0.05
# Of a parameter that is held, those are named that take up this much of it, each in its plausible size.
TAKES_UP = 0.2


@dataclass(frozen=True, eq=False)
class CompatibilityFit:
    """Estimates of one record.

    Attributes
    ----------
    names : tuple of str, length p
        Unknowns that the data tell, initial values first.
    estimate : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
    degrees_of_freedom : ndarray, shape (p,)
    undetermined : mapping of str to tuple of str
        Sensor errors that were asked for and are held where they started, at zero for errors, since the data
        do not tell them or put them beyond FARTHEST times their plausible size; with the unknowns that would
        take up an actual error of this kind.
    before, after : Prediction
        By initial values alone, and with the sensor errors.
    noise : PathNoise
        Levels that the weights rest on.
    gusts : GustStrength
    """

    names: tuple[str, ...]
    estimate: Array
    covariance: Array
    degrees_of_freedom: Array
    undetermined: dict[str, tuple[str, ...]]
    before: Prediction
    after: Prediction
    noise: PathNoise
    gusts: GustStrength


def fit_compatibility(
    problem: CompatibilityProblem,
    wanted: Collection[str],
    plausible: Array,
    gusts: float | None,
    gust_time: float,
) -> CompatibilityFit:
    """Estimate initial values and sensor errors by generalised least squares.

    Parameters
    ----------
    problem : CompatibilityProblem
    wanted : collection of str
        Sensor errors to try.
    plausible : ndarray, shape (m,)
        Size that each of the problem's unknowns may well have.
    gusts : float, optional
        Standard deviation of each axis of the gusts, m/s; estimated where absent.
    gust_time : float
        Their time constant, s.

    Returns
    -------
    CompatibilityFit

    Raises
    ------
    DataError
        The estimates do not settle, or a delay runs to its limit.

    Notes
    -----
    Gauss-Newton on columns that the filter of `whiten` has made white. Scales and delays of the air data are
    told by what the injected signals move (instruments), where these are known: the aircraft rides the gusts
    that its vanes show, so its whole motion would tell them wrongly. Gusts are as strong as makes the
    residuals most likely (`estimate_gusts`). Nothing is judged before the first steps have settled, since air
    data that are still late pass for gusts; from then on the instruments and the filter stay where they are,
    made anew only when an unknown is held. All steps but the last are held by the plausible sizes as prior
    knowledge, so that what is hardly told does not run away. Unknowns whose standard error without that
    knowledge is beyond LARGEST_ERROR_SHARE of their plausible size are held at zero, the worst first and one
    at a time: of two that only their sum is known of, one remains. So goes one that still moves after
    PATIENCE steps. The noise of the channels that are compared follows from the innovations, that of inertial
    sensors from what Fourier smoothing calls noise in them.
    """
    search = _Search.of(problem, wanted, plausible, gusts, gust_time)
    for _ in range(MOST_STEPS):
        settled = search.step()
        if settled is not None:
            return settled
    raise DataError(
        f"the compatibility check has not settled in {MOST_STEPS} steps",
        remedy="look for jumps in the record, cut it, or ask for fewer parameters",
    )


@dataclass(eq=False)
class _Search:
    """The iteration of `fit_compatibility`, and where it is.

    Attributes
    ----------
    problem : CompatibilityProblem
    everything : ndarray of bool, shape (m,)
        Unknowns that are asked for.
    plausible : ndarray, shape (m,)
    gusts : float, optional
        As given; estimated where absent.
    before : Prediction
        By initial values alone.
    least : ndarray, shape (k,)
        Least noise of the channels that are compared.
    air : bool
        Whether air data are among these.
    guess : Guess
    noise : PathNoise
    strength : GustStrength
    weighings : int
        Times that the gusts have been estimated.
    active : ndarray of bool, shape (m,)
        Unknowns that are not held.
    at : Prediction
        That the filter and the instruments rest on.
    steps : int
        Since an unknown was held last.
    free : bool
        Whether the first steps have settled, so that unknowns may be judged.
    """

    problem: CompatibilityProblem
    everything: Mask
    plausible: Array
    gusts: float | None
    before: Prediction
    least: Array
    air: bool
    guess: Guess
    noise: PathNoise
    strength: GustStrength
    weighings: int
    active: Mask
    at: Prediction
    steps: int = 0
    free: bool = False

    @classmethod
    def of(
        cls,
        problem: CompatibilityProblem,
        wanted: Collection[str],
        plausible: Array,
        gusts: float | None,
        gust_time: float,
    ) -> _Search:
        """Return the start: least squares without a filter, delays last."""
        everything = np.array([i < INITIAL or n in wanted for i, n in enumerate(problem.names)])
        initial = everything & (np.arange(everything.size) < INITIAL)
        guess, before = _fit_unfiltered(problem, initial, problem.start, plausible)
        # In gusts least squares may send scales and delays of the air data astray; where instruments tell
        # them, they start at zero.
        begun = everything if problem.driven is None else everything & ~problem.on_air
        # Delays come last: a wave fits itself again a period later, so they have to start near.
        clocked = np.array([not n.endswith("delay") for n in problem.names])
        guess, _ = _fit_unfiltered(problem, begun & clocked, guess, plausible)
        guess, now = _fit_unfiltered(problem, begun, guess, plausible)
        noise = _first_noise(problem, now, gusts or 0.0, gust_time)
        air = np.isin(problem.sensors.names, (*FLOW, *VELOCITY))
        return cls(
            problem=problem,
            everything=everything,
            plausible=plausible,
            gusts=gusts,
            before=before,
            # What is white at the highest frequencies is noise, whatever gusts may explain of it.
            least=np.where(air & (gusts is None), noise.outputs, _floor(before)),
            air=bool(air.any()),
            guess=guess,
            noise=noise,
            strength=GustStrength(noise.gusts, noise.gusts, noise.gusts, 0.0),
            weighings=0 if gusts is None else MOST_WEIGHINGS,
            active=everything,
            at=now,
        )

    @property
    def every(self) -> int:
        """Samples of one block of the filter."""
        return block_of(self.problem.sensors.dt, self.problem.window)

    def step(self) -> CompatibilityFit | None:
        """Take one step, or hold one unknown; return the fit once nothing is left to do."""
        problem, plausible = self.problem, self.plausible
        orphans = _scales_alone(problem, self.everything, self.active)
        if orphans.any():
            self.guess, self.active = self.guess.back(orphans, problem.start), self.active & ~orphans
        active = self.active
        now = problem.predict(self.guess)
        if not self.free or self.steps == 0:
            self.at = now
        beside = now.jacobian[:0] if problem.driven is None else self.at.instruments
        rows = np.concatenate((now.residual[None], now.jacobian, beside))
        if self.air and not self.weighings:
            self._weigh_gusts(rows)
            self.weighings, self.noise = 1, replace(self.noise, gusts=self.strength.std)
        white, _ = whiten(self.at.path, problem.window, self.at.seen, self.noise, rows, self.every)
        columns = 1 + len(self.everything)
        residual, jacobian = white[0], white[1:columns]
        # Gusts mislead scales and delays of the air data; where none is left there is nothing to be misled.
        by_instruments = problem.driven is not None and (active & problem.on_air).any()
        explained = _explained(jacobian, white[columns:], active) if by_instruments else jacobian
        observable = active
        if self.free and by_instruments:
            observable = _reached(jacobian, explained, problem, active, plausible)
        if self.free and np.array_equal(observable, active):
            observable = _observable(explained, active, plausible)
        if not np.array_equal(observable, active):
            return self._hold(active & ~observable)
        size, away = plausible[active], (self.guess.values - problem.start.values)[active]
        fit = _solve(explained[active], residual, size, 1.0, away, jacobian[active])
        outputs = np.maximum(self.noise.outputs * fit.spread, self.least)
        blocked = problem.blocked(self.guess, active, fit.step) if self.free else []
        # The noise of a channel that gusts drown creeps long after the estimates rest.
        rests = fit.largest < SETTLED and self.steps >= FULL_STEPS
        level = rests or np.allclose(outputs, self.noise.outputs, rtol=STEADY, atol=0)
        if not self.free and (
            self.steps >= FULL_STEPS or (self.steps >= HELD_STEPS and fit.largest < NEARLY)
        ):
            self.free, self.steps = True, 0
            self.guess = problem.moved(self.guess, active, fit.step)
            if self.air and self.gusts is None:  # what was late has passed for gusts
                self._weigh_gusts(rows)
                self.noise = replace(self.noise, gusts=self.strength.std)
            self.noise = replace(self.noise, outputs=outputs)
            return None
        steady = self.free and fit.largest < NEARLY and level
        if steady and self.air and self.steps > 0 and self.weighings < MOST_WEIGHINGS:
            self._weigh_gusts(rows)
            self.weighings += 1
            if not np.isclose(self.strength.std, self.noise.gusts, rtol=STEADY, atol=CALM):
                self.noise = replace(self.noise, gusts=self.strength.std)
                self.guess = problem.moved(self.guess, active, fit.step)
                self.steps += 1
                return None
        if steady or blocked:
            covariance, dof = coloured_covariance(explained[active], fit.left)
            if problem.driven is None:
                ridden = _ridden(problem.names, active, covariance, self.strength)
                covariance = covariance + np.diag(ridden**2)
            share = np.zeros(active.size)
            share[active] = np.sqrt(np.diag(covariance)) / size
            beyond = np.abs(self.guess.values - problem.start.values) > FARTHEST * plausible
            share[beyond & active & (np.arange(active.size) >= INITIAL)] = np.inf
            worst = blocked[0] if blocked else int(np.argmax(share))
            if share[worst] > LARGEST_ERROR_SHARE:
                worst = _scale_first(problem.names, worst, active)
                return self._hold(np.arange(active.size) == worst)
            if fit.largest < SETTLED:
                if self.air and self.gusts is None:
                    self._weigh_gusts(rows, limits=True)
                last = _solve(explained[active], residual, size, FAINT, away, jacobian[active])
                self.guess = problem.moved(self.guess, active, last.step)
                return self._settled(covariance, dof, jacobian)
            if blocked:
                raise DataError(
                    f"'{problem.names[worst]}' runs to {self.guess.values[worst]:.3g} s, the limit of delays",
                    remedy="raise longest_delay_s, or align the log's clocks first",
                )
        if self.free and self.steps >= PATIENCE:
            share = np.zeros(active.size)
            share[active] = fit.error / size * (np.abs(fit.step) > SETTLED * fit.error)
            share[:INITIAL] = 0.0
            if share.any():
                return self._hold(np.arange(active.size) == np.argmax(share))
        self.noise = replace(self.noise, outputs=outputs)
        step = fit.step if self.steps < FULL_STEPS else fit.step / 2
        self.guess = problem.moved(self.guess, active, step)
        self.steps += 1
        return None

    def _weigh_gusts(self, rows: Array, limits: bool = False) -> None:
        tried = rows[: 1 + self.active.size][np.append(True, self.active)]
        self.strength = estimate_gusts(
            self.at.path, self.problem.window, self.at.seen, self.noise, tried, self.every, limits=limits
        )

    def _hold(self, unknowns: Mask) -> None:
        """Put unknowns back to where they started, and judge the others anew."""
        self.guess, self.steps = self.guess.back(unknowns, self.problem.start), 0
        self.active = self.active & ~unknowns

    def _settled(self, covariance: Array, dof: Array, jacobian: Array) -> CompatibilityFit:
        names, active = self.problem.names, self.active
        held = self.everything & ~active
        return CompatibilityFit(
            names=tuple(n for n, a in zip(names, active, strict=True) if a),
            estimate=self.guess.values[active],
            covariance=covariance,
            degrees_of_freedom=dof,
            undetermined=_absorbed_by(names, jacobian, active, held, self.plausible),
            before=self.before,
            after=self.problem.predict(self.guess),
            noise=self.noise,
            gusts=self.strength,
        )


def _explained(jacobian: Array, instruments: Array, active: Mask) -> Array:
    """Return derivatives as far as instruments explain them: what least squares is to be done on.

    Without instruments all of them. Two-stage least squares, as in `two_stage_least_squares`, on columns that
    are white.
    """
    if not len(instruments):
        return jacobian
    flat = jacobian.reshape(len(jacobian), -1)
    chosen = instruments.reshape(flat.shape)[active]
    length = np.linalg.norm(chosen, axis=1, keepdims=True)
    basis = np.linalg.qr((chosen / np.maximum(length, _TINY)).T)[0]
    return ((flat @ basis) @ basis.T).reshape(jacobian.shape)


def _scales_alone(problem: CompatibilityProblem, wanted: Mask, active: Mask) -> Mask:
    """Return scales of air data whose delay was asked for and is held: they would take the delay up.

    Only beside instruments: without these the standard errors say what gusts may do.
    """
    alone = np.zeros(active.size, dtype=bool)
    if problem.driven is None:
        return alone
    for row in np.flatnonzero(active & problem.on_air):
        channel, _, kind = problem.names[row].partition(" ")
        late = problem.names.index(f"{channel} delay")
        alone[row] = kind == "scale" and wanted[late] and not active[late]
    return alone


def _scale_first(names: tuple[str, ...], worst: int, active: Mask) -> int:
    """Return what is to be held: of a delay its channel's scale first, which would take the delay up."""
    channel, _, kind = names[worst].partition(" ")
    scale = f"{channel} scale"
    if kind == "delay" and scale in names and active[names.index(scale)]:
        return names.index(scale)
    return worst


def _reached(
    jacobian: Array, explained: Array, problem: CompatibilityProblem, active: Mask, plausible: Array
) -> Mask:
    """Return the unknowns without the one that the injected signals tell worst, where that is too weak.

    First-stage F as in `two_stage_least_squares`; one at a time, since what is weak makes its neighbours look
    weak.
    """
    size, n = plausible[active], jacobian.shape[2]
    columns = np.concatenate((_columns(explained[active], size), FAINT * np.eye(size.size)))
    alone = 1 / (np.linalg.inv(np.linalg.qr(columns, mode="r")) ** 2).sum(axis=1)
    left = (_columns(jacobian[active] - explained[active], size) ** 2).sum(axis=0) / n  # of one channel
    strength = alone / np.maximum(left, _TINY)
    at = {row: i for i, row in enumerate(np.flatnonzero(active))}
    weak = [
        (strength[i], row) for row, i in at.items() if problem.on_air[row] and strength[i] < LEAST_STRENGTH
    ]
    reached = active.copy()
    if weak:
        reached[_scale_first(problem.names, int(min(weak)[1]), active)] = False
    return reached


def _ridden(names: tuple[str, ...], active: Mask, covariance: Array, strength: GustStrength) -> Array:
    """Return by how much an aircraft that rides the gusts may mislead scales and delays of the air data.

    Gusts make ``strength.equations`` of the equations. In these the motion is at most the gust itself (an
    aircraft that rides it wholly), so the sum of motion times gust is at most that number in a scale's
    equations, and RIDING times it in a delay's, where the motion's slope stands. An even chance of
    everything up to there has the standard deviation of that over root three.
    """
    each = strength.equations / 3  # of the three axes
    may = np.zeros(int(active.sum()))
    for row, name in enumerate(n for n, a in zip(names, active, strict=True) if a):
        first, _, kind = name.partition(" ")
        if first in _AIR and kind in ("scale", "delay"):
            rate = RIDING if kind == "delay" else 1.0
            may[row] = covariance[row, row] * each * rate / np.sqrt(3)
    return may


def _observable(jacobian: Array, active: Mask, plausible: Array) -> Mask:
    """Return the unknowns that are observable in white residuals; the worst is left out, one at a time."""
    observable = active.copy()
    while True:
        size = plausible[observable]
        columns = np.concatenate((_columns(jacobian[observable], size), FAINT * np.eye(size.size)))
        share = np.sqrt((np.linalg.inv(np.linalg.qr(columns, mode="r")) ** 2).sum(axis=1))
        if share.max() <= LARGEST_ERROR_SHARE:
            return observable
        observable[np.flatnonzero(observable)[np.argmax(share)]] = False


def _absorbed_by(
    names: tuple[str, ...], jacobian: Array, active: Mask, held: Mask, plausible: Array
) -> dict[str, tuple[str, ...]]:
    """Return, by each sensor error that is held, the unknowns that would take it up."""
    held = held & (np.arange(held.size) >= INITIAL)
    if not held.any():
        return {}
    left = [n for n, a in zip(names, active, strict=True) if a]
    columns, wanted = (_columns(jacobian[m], plausible[m]) for m in (active, held))
    shares = np.linalg.lstsq(columns, wanted)[0].T
    return {
        name: tuple(n for n, s in zip(left, share, strict=True) if abs(s) > TAKES_UP)
        for name, share in zip((n for n, h in zip(names, held, strict=True) if h), shares, strict=True)
    }


def _fit_unfiltered(
    problem: CompatibilityProblem, active: Mask, guess: Guess, plausible: Array
) -> tuple[Guess, Prediction]:
    """Return the fit of least squares with weights by each channel's residual, held by plausible sizes."""
    now = problem.predict(guess)
    for _ in range(MOST_STEPS):
        weight = 1 / np.maximum(now.residual.std(axis=1), _floor(now))[:, None]
        away = (guess.values - problem.start.values)[active]
        columns, target = now.jacobian[active] * weight, now.residual * weight
        step = _solve(columns, target, plausible[active], 1.0, away).step
        guess = problem.moved(guess, active, step)
        then = problem.predict(guess)
        change = np.abs(then.modelled - now.modelled).max(axis=1) * weight[:, 0]
        now = then
        if (change < SETTLED).all():
            break
    return guess, now


@dataclass(frozen=True, eq=False)
class _Step:
    """One solution of the whitened problem: the step, its standard errors, and what is left, shape (k, n)."""

    step: Array
    error: Array
    left: Array

    @property
    def largest(self) -> float:
        """Largest step beside its standard error."""
        return float((np.abs(self.step) / self.error).max())

    @property
    def spread(self) -> Array:
        """Standard deviation of what is left of each channel, shape (k,)."""
        k, n = self.left.shape
        return np.sqrt((self.left**2).sum(axis=1) / (n - len(self.step) / k))


def _solve(
    jacobian: Array,
    residual: Array,
    size: Array,
    prior: float,
    away: Array,
    measured: Array | None = None,
) -> _Step:
    """Solve for a step in units of plausible sizes.

    `prior` weighs the knowledge that unknowns, now so far `away` from where they started, stay near it.
    Where `jacobian` is what instruments explain, `measured` are the derivatives that the residual has.
    """
    m = len(jacobian)
    columns = np.concatenate((_columns(jacobian, size), prior * np.eye(m)))
    basis, factor = np.linalg.qr(columns)
    target = np.concatenate((residual.ravel(), -prior * away / size))
    step = np.linalg.solve(factor, basis.T @ target) * size
    error = np.sqrt((np.linalg.inv(factor) ** 2).sum(axis=1)) * size
    taken = jacobian if measured is None else measured
    return _Step(step, error, residual - np.einsum("m,mkn->kn", step, taken))


def _columns(jacobian: Array, size: Array) -> Array:
    """Return derivatives by unknowns in units of their plausible sizes, shape (k n, m)."""
    return jacobian.reshape(len(jacobian), jacobian[0].size).T * size


def _first_noise(problem: CompatibilityProblem, now: Prediction, gusts: float, gust_time: float) -> PathNoise:
    sensors = problem.sensors
    inputs = smooth(np.concatenate((sensors.rates, sensors.force)), sensors.dt).noise_std
    outputs = np.maximum(smooth(sensors.values, sensors.dt).noise_std, _floor(now))
    return PathNoise(inputs[:3], inputs[3:], gusts, gust_time, outputs)


def _floor(now: Prediction) -> Array:
    """Return the least noise that a channel is believed to have: nothing is exact beyond its rounding."""
    return 1e-6 * np.abs(now.modelled).max(axis=1) + 1e-9
