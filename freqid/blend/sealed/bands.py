"""The free-running response of a model under its control law, and the bands that it is meant to stay in.

Four things put the flight off the prediction: errors of the parameters, by models drawn from their
covariance; loads that the fit left unexplained, driven through the closed loop; stated gusts, likewise; and
the noise of each channel's own sensor (docs/theory/sealed-predictions.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend
from scipy.stats import chi2

from freqid.blend.sealed.condition import ModelAtCondition
from freqid.core.arrays import Array, Complex
from freqid.core.channels import STATE, WRENCH
from freqid.core.errors import UsageError
from freqid.core.results.design import SampledInputs
from freqid.core.results.prediction import PredictedChannel
from freqid.design.forecast.closed_loop import SPECIFIC_FORCES
from freqid.design.forecast.experiment import response_noise
from freqid.dynamics.controlled import ControlledAircraft
from freqid.dynamics.small_motion import STATES
from freqid.simulate.air.dryden import Dryden

POINTS = 25  # samples in the shortest period that a predicted history has at least
POOLED = 24  # lines over which the power of a residual is averaged
BY_CHANCE = 0.05  # probability that a residual of sensor noise alone is taken for a load
BEYOND = 1.5  # times the highest line, up to which the residual is taken to go on as it ends
GUST_RANGE = 3.0  # times the highest line, up to which gusts move the aircraft


@dataclass(frozen=True, eq=False)
class FreeRun:
    """The free-running response with its bands.

    Attributes
    ----------
    time : ndarray, shape (sample,)
    channels : tuple of PredictedChannel
    unstable_draws : float
        Share of the drawn models whose loop is unstable.
    wrench_hz : float
        Up to which the bands of the wrench hold noise: the model's highest line, or the top of the design's
        band where the model was identified in time.
    """

    time: Array
    channels: tuple[PredictedChannel, ...]
    unstable_draws: float
    wrench_hz: float


def free_run(
    model: ModelAtCondition,
    aircraft: ControlledAircraft,
    inputs: SampledInputs,
    band_hz: tuple[float, float],
    noise: Mapping[str, float],
    *,
    gusts: Dryden | None = None,
    draws: int = 100,
    seed: int = 0,
) -> FreeRun:
    """Predict what a design does to the aircraft in its control loop.

    Parameters
    ----------
    model : ModelAtCondition
    aircraft : ControlledAircraft
        Of that model.
    inputs : SampledInputs
        The design.
    band_hz : tuple of 2 floats
        Of the design.
    noise : mapping of str to float
        One sigma of a sample by state, effector or ``ax ay az``, SI; zero where a name is absent.
    gusts : Dryden, optional
    draws : int
        Models drawn from the covariance, at least two.
    seed : int

    Raises
    ------
    UsageError
        Where the design excites what the model's aircraft does not have, or the loop is unstable.
    """
    names = aircraft.law.effectors
    refuse_unstable(aircraft, float(inputs.time[-1]))
    injected = np.zeros((len(names), inputs.time.size))
    for name, row in zip(inputs.names, inputs.values, strict=True):
        injected[names.index(name)] = row
    dt = float(inputs.time[1] - inputs.time[0])
    top = model.highest_hz if np.isfinite(model.highest_hz) else band_hz[1]
    thin = max(1, int(1 / (POINTS * max(top, band_hz[1]) * dt) + 1e-9))

    def response(one: ControlledAircraft, uneven: bool) -> Array:
        both = np.concatenate(one.history(injected, dt, uneven=uneven))[:, ::thin]
        return np.concatenate([both, one.wrench @ both])

    change, linear = response(aircraft, True), response(aircraft, False)
    square, unstable = np.zeros_like(change), 0
    for estimates in model.draw(draws, seed):
        one = aircraft.with_wrench(model.wrench(names, estimates))
        unstable += not one.loop.stable
        off = response(one, False) - linear
        square += detrend(off) ** 2
    time = inputs.time[::thin]
    steady = _steady(model, aircraft, float(inputs.time[-1]), top, band_hz, noise, gusts)
    own = _sensor_noise(model, aircraft, 1 / dt, top, band_hz, noise)
    units = [STATE[n][0] for n in STATES] + [aircraft.vehicle.effector(n).unit for n in names]
    units += ["N"] * 3 + ["N m"] * 3
    kinds = ["state"] * 8 + ["effector"] * len(names) + ["wrench"] * 6
    trims = model.trim | {"theta": model.theta, "phi": 0.0} | dict(zip("uvw", model.velocity, strict=True))
    trims |= {r.response: r.bias for r in model.responses}
    channels = []
    for i, (name, kind) in enumerate(zip((*STATES, *names, *WRENCH), kinds, strict=True)):
        if not change[i].any():
            continue
        channels.append(
            PredictedChannel(
                name=name,
                unit=units[i],
                kind=kind,
                trim=float(trims.get(name, np.nan)),
                change=change[i],
                parameter_std=np.sqrt(square[i] / draws),
                residual_std=float(np.sqrt(steady.residual[i])),
                gust_std=float(np.sqrt(steady.gust[i])),
                noise_std=float(np.sqrt(own[i, 0])),
                band_std=float(np.sqrt(steady.in_band[i] + own[i, 1])),
            )
        )
    return FreeRun(time, tuple(channels), unstable / draws, float(top))


def refuse_unstable(aircraft: ControlledAircraft, duration: float) -> None:
    """Raise where a motion grows to its double, or faster, within the flight.

    Raises
    ------
    UsageError
    """
    loop = aircraft.loop
    values, vectors = np.linalg.eig(loop.closed)
    worst = int(np.argmax(np.real(values)))
    mode = values[worst]
    if mode.real * duration < np.log(2):
        return
    part = np.abs(vectors[: len(STATES), worst]) * _ALIKE
    first, second = (STATES[i] for i in np.argsort(-part)[:2])
    kind = f"an oscillation of {abs(mode.imag) / (2 * np.pi):.3g} Hz" if abs(mode.imag) > 1e-9 else "a motion"
    raise UsageError(
        f"the free-running response is unstable: {kind} in {first} and {second} doubles in "
        f"{np.log(2) / mode.real:.3g} s",
        remedy="predict with the control law that is flown, in [control] of the scenario or as --loop, or "
        "score the wrench alone from the flown states with identify-point --predict",
    )


_ALIKE = np.array([0.1] * 3 + [1.0] * 5)
"""What counts alike in a mode: m/s, rad/s and rad."""


@dataclass(frozen=True, eq=False)
class _Steady:
    """Variances by channel: states, positions, wrench."""

    residual: Array
    gust: Array
    in_band: Array


def _steady(
    model: ModelAtCondition,
    aircraft: ControlledAircraft,
    duration: float,
    top: float,
    band_hz: tuple[float, float],
    noise: Mapping[str, float],
    gusts: Dryden | None,
) -> _Steady:
    """Return what unexplained loads and gusts do to every channel."""
    step = 1 / duration
    f = np.asarray(step * np.arange(1, int(GUST_RANGE * top / step) + 1), dtype=np.float64)
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    still = np.zeros((len(aircraft.law.effectors), f.size), dtype=complex)

    def channels(added: Complex | None, gust: Complex | None) -> Complex:
        x, d = aircraft.motion(s, still, added, gust)
        both = np.concatenate([x, d])
        loads = aircraft.wrench @ both
        if gust is not None:
            loads = loads - aircraft.wrench[:, 3:6] @ gust[3:]
        return np.concatenate([both, loads if added is None else loads + added])

    total = 8 + len(aircraft.law.effectors) + 6
    inside = (f >= band_hz[0] - 0.5 * step) & (f <= band_hz[1] + 0.5 * step)
    measured = np.ones((total, f.size), dtype=bool)
    measured[-6:] = f <= top * (1 + 1e-9)
    residual, gust, in_band = np.zeros((3, total))
    density = _unexplained(model, aircraft, f, noise, band_hz)
    if density is not None:
        unit = np.eye(6)[:, :, None] * np.ones(f.size)
        response = np.array([channels(one.astype(complex), None) for one in unit])  # (load, channel, f)
        power = np.einsum("acf,fab,bcf->cf", response, density, response.conj()).real
        power[:, f > BEYOND * top] = 0.0
        residual = step * (power * measured).sum(axis=1)
        in_band += step * (power * inside).sum(axis=1)
    if gusts is not None:
        for one in _gust_sources(gusts, f):
            power = np.abs(channels(None, one)) ** 2
            gust += step * (power * measured).sum(axis=1)
            in_band += step * (power * inside).sum(axis=1)
    return _Steady(residual, gust, in_band)


def _gust_sources(gusts: Dryden, f: Array) -> list[Complex]:
    """Return independent gusts as amplitude densities, shape (6, line) each, one-sided per Hz.

    Transverse gusts bring the rotation of their gradient along the path, as in MIL-F-8785C, 3.7.2.
    """
    omega = 2 * np.pi * f
    root = np.sqrt(2 * np.pi * gusts.spectrum(omega))  # the spectrum is per rad/s
    gradient = 1j * omega / gusts.airspeed
    tau = gusts.span / (np.pi * gusts.airspeed)
    sources = np.zeros((4, 6, f.size), dtype=complex)
    for i in range(4):
        sources[i, i] = root[i]
    sources[2, 4] = -gradient / (1 + 4 * tau * 1j * omega) * root[2]
    sources[1, 5] = gradient / (1 + 3 * tau * 1j * omega) * root[1]
    return list(sources)


def _unexplained(
    model: ModelAtCondition,
    aircraft: ControlledAircraft,
    f: Array,
    noise: Mapping[str, float],
    band_hz: tuple[float, float],
) -> Complex | None:
    """Return the density of loads that the fit left and no sensor explains, shape (line, 6, 6), one-sided.

    None where the model keeps no residual on lines, or responses were fitted on different ones.
    """
    by_name = {r.response: r for r in model.responses}
    every = [by_name[n] for n in WRENCH]
    grids = [r.residual_hz for r in every]
    if not grids[0].size or any(not np.array_equal(g, grids[0]) for g in grids):
        return None
    order = np.argsort(grids[0], kind="stable")
    hz, left = grids[0][order], np.array([r.residual[order] for r in every])
    alone = np.array([r.residual_noise[order] for r in every])
    spacing = float(np.median(np.diff(np.unique(hz))))
    slow = int(np.count_nonzero(hz < band_hz[0]))
    # a distortion lives on excited lines alone, and the next design excites as many
    thinned = min(1.0, 1 / (every[0].duration * spacing))
    d = _sensors_in_residual(model, aircraft, hz, noise)
    pools = np.array_split(np.arange(slow, hz.size), max(1, (hz.size - slow) // POOLED))
    pools += [np.array([i]) for i in range(slow)]  # a drift is steep
    centres, densities = [], []
    for pool in pools:
        found = left[:, pool] @ left[:, pool].conj().T / pool.size
        power = np.mean(np.abs(left[:, pool]) ** 2, axis=1)
        random = np.ones(6)
        if np.isfinite(alone[:, pool]).all():
            random = np.minimum(np.mean(alone[:, pool] ** 2, axis=1) / np.maximum(power, 1e-300), 1.0)
        own = np.einsum("lrs,lqs->rq", d[pool], d[pool].conj()) / pool.size
        chance, twisted = np.sqrt(random), np.sqrt(1 - random)
        # what is explained by the stated sensors, within the scatter of so few lines, moves nothing
        process = _positive(found * np.outer(chance, chance) - own)
        above = chi2.isf(BY_CHANCE, 2 * pool.size) / (2 * pool.size)
        loads = (random * power > above * np.real(np.diag(own))).astype(float)
        process = process * np.outer(loads, loads)
        centres.append(float(hz[pool].mean()))
        densities.append(process + thinned * found * np.outer(twisted, twisted))
    place = np.abs(np.log(f[:, None] / np.array(centres))).argmin(axis=1)
    return np.array(densities)[place]


def _sensors_in_residual(
    model: ModelAtCondition, aircraft: ControlledAircraft, hz: Array, noise: Mapping[str, float]
) -> Complex:
    """Return what each sensor leaves in each residual, as amplitude densities, shape (line, 6, sensor)."""
    names = (*STATES, *aircraft.law.effectors, *SPECIFIC_FORCES)
    sigma = np.array([noise.get(n, 0.0) for n in names])
    rate = model.responses[0].rate_hz
    mass = aircraft.vehicle.mass_properties
    rows = []
    for row in range(6):
        k = response_noise(row, mass, aircraft.spin, aircraft.momentum, np.zeros(3), hz)
        k[:, : aircraft.wrench.shape[1]] -= aircraft.wrench[row]
        rows.append(k * sigma * np.sqrt(2 / rate))
    return np.swapaxes(np.array(rows), 0, 1)


def _positive(matrix: Complex) -> Complex:
    """Return the nearest Hermitian matrix without negative eigenvalues, once all rows count alike."""
    size = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    scaled = (vectors * np.maximum(values, 0.0)) @ vectors.conj().T
    return np.asarray(scaled * np.outer(size, size), dtype=np.complex128)


def _sensor_noise(
    model: ModelAtCondition,
    aircraft: ControlledAircraft,
    rate_hz: float,
    top: float,
    band_hz: tuple[float, float],
    noise: Mapping[str, float],
) -> Array:
    """Return the variance of the noise of each channel, and of its part in the band, shape (channel, 2)."""
    rate = model.responses[0].rate_hz
    rate = rate if np.isfinite(rate) else rate_hz
    names = (*STATES, *aircraft.law.effectors)
    sigma = np.array([noise.get(n, 0.0) for n in names])
    width = 2 * (band_hz[1] - band_hz[0]) / rate
    rows = [(v, v * min(width, 1.0)) for v in sigma**2]
    f = np.linspace(top / 400, top, 400)
    every = np.concatenate([sigma, [noise.get(n, 0.0) for n in SPECIFIC_FORCES]])
    mass = aircraft.vehicle.mass_properties
    for row in range(6):
        k = response_noise(row, mass, aircraft.spin, aircraft.momentum, np.zeros(3), f)
        power = 2 / rate * (np.abs(k) ** 2) @ every**2
        inside = (f >= band_hz[0]) & (f <= band_hz[1])
        rows.append((power.sum() * f[0], power[inside].sum() * f[0]))
    return np.array(rows)
