"""What rigid-body kinematics and commands imply of a channel, beside what was logged.

Notes
-----
Each relation compares two signals a and b that are equal for ideal sensors, by their concordance::

    c = 2 <a, b> / (|a|^2 + |b|^2)

(Lin, Biometrics 45, 1989, about zero): 1 where they are equal, 2 g / (1 + g^2) where b is g times a, -1 where
the sign is opposite, 0 where they have nothing in common. Relations with derivatives are integrated on
Fourier lines, so that no noise is differentiated, after a line is taken away: biases drop out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import get_window

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord

G = 9.80665
HIGHEST_HZ = 5.0  # rigid-body motion and its control lie below
NYQUIST_SHARE = 0.8  # of the lowest Nyquist frequency of the channels used
LOWEST_PERIODS = 4.0  # in the record, of the lowest line: below, what a taper leaves of trends counts
# Of the change of velocity that a specific force must make to be judged by itself: air data have scale errors
# of some per cent, and what these leave of the larger terms must stay below it.
SEEN = 0.3
BLOCK_S = 1.0  # over which means are taken where means are compared
ENOUGH_HZ = 2.5 * HIGHEST_HZ / NYQUIST_SHARE  # of samples, that hold the highest line with room for averaging
MOST_SAMPLES = 60_000  # longer records are averaged over as many samples as it takes
Pair = tuple[NDArray, NDArray]


@dataclass
class Signals:
    """A record's channels as one assumption about their units, signs and columns has them.

    Attributes
    ----------
    record : FlightRecord
    factor : mapping of str to float
        By channel: what its values are multiplied by; 1 where absent.
    column : mapping of str to str
        By channel: the one whose values are taken instead.
    """

    record: FlightRecord
    factor: Mapping[str, float] = field(default_factory=dict)
    column: Mapping[str, str] = field(default_factory=dict)

    def __contains__(self, name: str) -> bool:
        return name in self.record

    def has(self, *names: str) -> bool:
        """Tell whether all these channels were logged."""
        return all(name in self.record for name in names)

    def __getitem__(self, name: str) -> Array:
        """Return a channel, shape (sample,); zeros where it was not logged."""
        if name not in self.record:
            return np.zeros(self.record.time.size)
        factor = self.factor.get(name, 1.0)
        values = self.record[self.column.get(name, name)]
        values = values if factor == 1.0 else factor * values
        return np.unwrap(values) if name in ("state/phi", "state/psi") else values

    def lines(self, *names: str) -> tuple[Callable[[Array], NDArray], NDArray]:
        """Return the transform onto the lines that all these channels can tell, and 1 / (j omega) there."""
        record = self.record
        rate = min(1 / record.dt, *(record.channel(n).native_rate_hz for n in names if n in record))
        n = record.time.size
        f = np.fft.rfftfreq(n, record.dt)
        low = LOWEST_PERIODS / record.duration
        kept = (f >= low) & (f <= min(NYQUIST_SHARE * 0.5 * rate, HIGHEST_HZ))
        window, ramp = _taper(n), np.linspace(-1.0, 1.0, n)
        steepness = ramp / np.sum(ramp**2)

        def transform(x: Array) -> NDArray:
            flat = x - x.mean() - (steepness @ x) * ramp
            return np.fft.rfft(window * flat)[kept]

        return transform, 1 / (2j * np.pi * f[kept])

    def blocks(self, x: Array) -> Array:
        """Return the means of whole blocks, shape (block,)."""
        size = max(1, round(BLOCK_S / self.record.dt))
        count = x.size // size
        return x[: count * size].reshape(count, size).mean(axis=1) if count else x.mean(keepdims=True)

    def velocity(self) -> tuple[Array, Array, Array] | None:
        """Return u v w relative to the air, logged or from V, alpha and beta; None where unknown."""
        if self.has("state/u", "state/w"):
            return self["state/u"], self["state/v"], self["state/w"]
        if self.has("air/V", "air/alpha"):
            return self.flow()
        return None

    def flow(self) -> tuple[Array, Array, Array]:
        """Return u v w from V, alpha and beta."""
        speed, alpha, beta = self["air/V"], self["air/alpha"], self["air/beta"]
        return (
            speed * np.cos(alpha) * np.cos(beta),
            speed * np.sin(beta),
            speed * np.sin(alpha) * np.cos(beta),
        )


@lru_cache(maxsize=4)
def _taper(samples: int) -> Array:
    return get_window("hann", samples)


@dataclass(frozen=True)
class Agreement:
    """How far what was logged and what is implied agree.

    Attributes
    ----------
    concordance : float
    correlation : float
    gain : float
        Root mean square of what was logged over that of what is implied; nan where the latter is zero.
    equations : float
        Independent real numbers that were compared, in effect: the participation number of the lines.
    """

    concordance: float
    correlation: float
    gain: float
    equations: float


def compare(logged: NDArray, implied: NDArray) -> Agreement | None:
    """Return the agreement of two signals; None where there is nothing to compare."""
    a, b = np.abs(logged) ** 2, np.abs(implied) ** 2
    total = a.sum() + b.sum()
    if not np.isfinite(total) or total <= 0:
        return None
    product = float(np.real(np.vdot(logged, implied)))
    size = float(np.sqrt(a.sum() * b.sum()))
    power = a / total + b / total
    real = 2 if np.iscomplexobj(logged) or np.iscomplexobj(implied) else 1
    return Agreement(
        concordance=2 * product / float(total),
        correlation=product / size if size else 0.0,
        gain=float(np.sqrt(a.sum() / b.sum())) if b.sum() else float("nan"),
        equations=real * float(1 / np.sum(power**2)),
    )


@dataclass(frozen=True)
class Relation:
    """Two signals that are equal for ideal sensors.

    Attributes
    ----------
    name : str
        What is compared, for people.
    channels : tuple of str
        All that enter, in the order in which they matter.
    pair : callable
        ``pair(signals) -> (logged, implied)``.
    """

    name: str
    channels: tuple[str, ...]
    pair: Callable[[Signals], Pair]

    def agreement(self, signals: Signals) -> Agreement | None:
        """Compare the two under one assumption."""
        return compare(*self.pair(signals))


def relations(record: FlightRecord) -> list[Relation]:
    """Return all relations that a record's channels allow."""
    s = Signals(record)
    return [
        *_attitude(s),
        *_accelerations(s),
        *_velocity(s),
        *_gravity(s),
        *_air(s),
        *_height(s),
        *_inputs(s),
    ]


def thinned(record: FlightRecord) -> FlightRecord:
    """Return a record of means of as many samples as leave `ENOUGH_HZ`, of a length that transforms fast."""
    rate = 1 / record.dt
    size = max(1, int(rate / ENOUGH_HZ), -(-record.time.size // MOST_SAMPLES))
    count = record.time.size // size
    count = next(n for n in range(count, 0, -1) if next_fast_len(n, real=True) == n)

    def mean(x: Array) -> Array:
        return x[: count * size].reshape(count, size).mean(axis=1)

    channels = {
        n: replace(c, values=mean(np.unwrap(c.values) if n in ("state/phi", "state/psi") else c.values))
        for n, c in record.channels.items()
    }
    return replace(record, time=mean(record.time), channels=channels)


def _integrated(
    name: str, channels: tuple[str, ...], logged: Callable[[Signals], Array], rate: Callable[[Signals], Array]
) -> Relation:
    """Return ``logged = integral of rate`` on lines."""

    def pair(s: Signals) -> Pair:
        transform, integral = s.lines(*channels)
        return transform(logged(s)), integral * transform(rate(s))

    return Relation(name, channels, pair)


def _equal(
    name: str,
    channels: tuple[str, ...],
    logged: Callable[[Signals], Array],
    implied: Callable[[Signals], Array],
) -> Relation:
    """Return ``logged = implied`` on lines: means may differ."""

    def pair(s: Signals) -> Pair:
        transform, _ = s.lines(*channels)
        return transform(logged(s)), transform(implied(s))

    return Relation(name, channels, pair)


def _attitude(s: Signals) -> Iterator[Relation]:
    """Yield Euler's kinematics (Klein & Morelli, 2nd ed., eq. 3.20)."""

    def turn(s: Signals) -> tuple[Array, ...]:
        return s["state/phi"], s["state/theta"], s["state/p"], s["state/q"], s["state/r"]

    def roll(s: Signals) -> Array:
        phi, theta, p, q, r = turn(s)
        return p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta)

    def pitch(s: Signals) -> Array:
        phi, _, _, q, r = turn(s)
        return q * np.cos(phi) - r * np.sin(phi)

    def yaw(s: Signals) -> Array:
        phi, theta, _, q, r = turn(s)
        return (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)

    names = ("state/phi", "state/theta", "state/psi", "state/p", "state/q", "state/r")
    for angle, rate, name, change in (
        ("phi", "p", "roll angle", roll),
        ("theta", "q", "pitch angle", pitch),
        ("psi", "r", "heading", yaw),
    ):
        if s.has(f"state/{angle}", f"state/{rate}"):
            used = (f"state/{angle}", f"state/{rate}")
            more = tuple(n for n in names if n in s and n not in used and n != "state/psi")
            yield _integrated(name, used + more, lambda s, a=angle: s[f"state/{a}"], change)


def _accelerations(s: Signals) -> Iterator[Relation]:
    """Yield logged angular accelerations beside the rates."""
    for rate in "pqr":
        dot = f"state/{rate}dot"
        if s.has(f"state/{rate}", dot):
            yield _integrated(
                f"{rate} acceleration",
                (f"state/{rate}", dot),
                lambda s, n=rate: s[f"state/{n}"],
                lambda s, n=dot: s[n],
            )


def _weight(s: Signals) -> tuple[Array, Array, Array]:
    """Return gravity along the body axes, m/s2."""
    phi, theta = s["state/phi"], s["state/theta"]
    return (
        -G * np.sin(theta),
        G * np.sin(phi) * np.cos(theta),
        G * np.cos(phi) * np.cos(theta),
    )


def _velocity(s: Signals) -> Iterator[Relation]:
    """Yield the change of velocity beside specific force, gravity and the turning axes."""
    velocity = s.velocity()
    if velocity is None:
        return
    names = ("state/u", "state/v", "state/w") if s.has("state/u", "state/w") else ("air/V",)
    flow = () if s.has("state/u", "state/w") else ("air/alpha", "air/beta")

    def moving(s: Signals) -> tuple[Array, ...]:
        found = s.velocity()
        assert found is not None
        return found

    def rate(s: Signals, axis: int) -> Array:
        (u, v, w), weight = moving(s), _weight(s)[axis]
        p, q, r = s["state/p"], s["state/q"], s["state/r"]
        turning = (r * v - q * w, p * w - r * u, q * u - p * v)[axis]
        return s[f"state/a{'xyz'[axis]}"] + weight + turning

    needed = (
        ("state/ax", "state/theta", "state/q"),
        ("state/ay", "state/phi", "state/r", "state/p"),
        ("state/az", "state/theta", "state/q"),
    )
    own = (names[:1], ("state/v",) if not flow else ("air/beta",), ("state/w",) if not flow else flow[:1])
    for axis, (need, mine) in enumerate(zip(needed, own, strict=True)):
        if s.has(*need, *mine):
            rest = tuple(
                n
                for n in (*names, *flow, "state/phi", "state/theta", "state/p", "state/q", "state/r")
                if n in s and n not in need and n not in mine
            )
            yield _integrated(
                f"velocity along {'xyz'[axis]}",
                (*mine, *need, *rest),
                lambda s, k=axis: moving(s)[k],
                lambda s, k=axis: rate(s, k),
            )
            force = _force(axis, (*need[:1], *mine, *need[1:], *rest), moving, rate)
            felt, change = force.pair(s)[0], s.lines(*force.channels)[0](moving(s)[axis])
            if np.sum(np.abs(felt) ** 2) > SEEN**2 * np.sum(np.abs(change) ** 2):
                yield force


def _force(
    axis: int,
    channels: tuple[str, ...],
    moving: Callable[[Signals], tuple[Array, ...]],
    rate: Callable[[Signals, int], Array],
) -> Relation:
    """Return the same equation solved for the specific force, which may be small beside the other terms."""
    logged = f"state/a{'xyz'[axis]}"

    def pair(s: Signals) -> Pair:
        transform, integral = s.lines(*channels)
        felt = integral * transform(s[logged])
        return felt, transform(moving(s)[axis]) - integral * transform(rate(s, axis)) + felt

    return Relation(f"specific force along {'xyz'[axis]}", channels, pair)


def _gravity(s: Signals) -> Iterator[Relation]:
    """Yield means of specific force beside gravity, and what the turning axes add where that is known."""
    axes = [k for k, n in enumerate("xyz") if f"state/a{n}" in s]
    if 2 not in axes:
        return
    logged = tuple(f"state/a{'xyz'[k]}" for k in (2, *(k for k in axes if k != 2)))
    attitude = tuple(n for n in ("state/theta", "state/phi") if n in s)
    turning = s.velocity() is not None and s.has("state/p", "state/q", "state/r")

    def pair(s: Signals) -> Pair:
        weight = _weight(s)
        felt = [-weight[k] for k in range(3)]
        if turning:
            u, v, w = s.velocity() or (0.0, 0.0, 0.0)
            p, q, r = s["state/p"], s["state/q"], s["state/r"]
            felt = [f + t for f, t in zip(felt, (q * w - r * v, r * u - p * w, p * v - q * u), strict=True)]
        return (
            np.concatenate([s.blocks(s[f"state/a{'xyz'[k]}"]) for k in axes]),
            np.concatenate([s.blocks(np.broadcast_to(felt[k], s.record.time.shape)) for k in axes]),
        )

    rates = ("state/p", "state/q", "state/r") if turning else ()
    speeds = ("state/u", "state/v", "state/w") if s.has("state/u", "state/w") else ("air/V", "air/alpha")
    used = (*logged, *attitude, *rates, *(speeds if turning else ()))
    yield Relation("gravity", tuple(n for n in used if n in s), pair)


def _air(s: Signals) -> Iterator[Relation]:
    """Yield air data beside velocities and dynamic pressure."""
    if s.has("air/V", "state/u", "state/w"):

        def speed(s: Signals) -> Pair:
            u, v, w = s["state/u"], s["state/v"], s["state/w"]
            return s.blocks(s["air/V"]), s.blocks(np.sqrt(u**2 + v**2 + w**2))

        yield Relation(
            "airspeed", tuple(n for n in ("air/V", "state/u", "state/v", "state/w") if n in s), speed
        )
        for angle, axis, k in (("alpha", "w", 2), ("beta", "v", 1)):
            if s.has(f"air/{angle}", f"state/{axis}"):
                yield _equal(
                    f"flow angle {angle}",
                    (f"air/{angle}", f"state/{axis}", "air/V"),
                    lambda s, k=k: s.flow()[k],
                    lambda s, n=axis: s[f"state/{n}"],
                )
    if s.has("air/qbar", "air/rho", "air/V"):
        yield Relation(
            "dynamic pressure",
            ("air/qbar", "air/V", "air/rho"),
            lambda s: (s.blocks(s["air/qbar"]), s.blocks(0.5 * s["air/rho"] * s["air/V"] ** 2)),
        )


def _height(s: Signals) -> Iterator[Relation]:
    """Yield climbing: altitude beside velocities, over the ground or through the air."""
    if s.has("state/alt", "state/vd"):
        yield _integrated(
            "climb over the ground",
            ("state/alt", "state/vd"),
            lambda s: s["state/alt"],
            lambda s: -s["state/vd"],
        )
    yield from _lifted(s)
    if s.velocity() is None or not s.has("state/theta"):
        return
    speeds = ("state/u", "state/w", "state/v") if s.has("state/u", "state/w") else ("air/V", "air/alpha")
    attitude = ("state/theta", "state/phi")

    def climb(s: Signals) -> Array:
        u, v, w = s.velocity() or (0.0, 0.0, 0.0)
        phi, theta = s["state/phi"], s["state/theta"]
        return u * np.sin(theta) - (v * np.sin(phi) + w * np.cos(phi)) * np.cos(theta)

    used = tuple(n for n in (*speeds, *attitude) if n in s)
    if "state/alt" in s:
        yield _integrated("climb", ("state/alt", *used), lambda s: s["state/alt"], climb)
    if "state/vd" in s:
        yield _equal("vertical speed", ("state/vd", *used), lambda s: -s["state/vd"], climb)


def _lifted(s: Signals) -> Iterator[Relation]:
    """Yield altitude and sink rate beside the specific force turned into the vertical: no gust enters."""
    used = ("state/az", "state/theta", "state/phi", "state/ax", "state/ay")
    if not s.has(*used[:4]):
        return

    def sinking(s: Signals) -> Array:
        phi, theta = s["state/phi"], s["state/theta"]
        level = s["state/ay"] * np.sin(phi) + s["state/az"] * np.cos(phi)
        return level * np.cos(theta) - s["state/ax"] * np.sin(theta) + G

    used = tuple(n for n in used if n in s)
    if "state/vd" in s:
        yield _integrated("sink rate by accelerations", ("state/vd", *used), lambda s: s["state/vd"], sinking)
    if "state/alt" in s:

        def pair(s: Signals) -> Pair:
            transform, integral = s.lines("state/alt", *used)
            return transform(s["state/alt"]), -(integral**2) * transform(sinking(s))

        yield Relation("climb by accelerations", ("state/alt", *used), pair)


def _inputs(s: Signals) -> Iterator[Relation]:
    """Yield positions beside commands, and either beside the injected signal where the other is missing."""
    record = s.record
    for name in dict.fromkeys((*record.group("effector"), *record.group("command"))):
        chain = [f"{g}/{name}" for g in ("effector", "command", "excitation") if f"{g}/{name}" in record]
        for here, there in pairwise(chain):
            if record.channel(here).unit != record.channel(there).unit or np.ptp(record[there]) == 0:
                continue
            label = f"{here.replace('/', ' ')} and {there.partition('/')[0]}"
            mean = record.channel(here).unit in ("rad/s", "N", "1") and not there.startswith("excitation/")
            if mean:  # a quantity with a true zero, never negative: its mean tells the unit best
                yield Relation(
                    label, (here, there), lambda s, a=here, b=there: (s.blocks(s[a]), s.blocks(s[b]))
                )
            yield _equal(
                f"{label}, changes" if mean else label,
                (here, there),
                lambda s, a=here: s[a],
                lambda s, b=there: s[b],
            )
