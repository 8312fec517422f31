"""A manoeuvre with the delays of its sensors taken out, and those delays found by kinematics on lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.optimize import nnls

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, FORCES, GROUND, RATES, VELOCITY
from freqid.core.record import Channel, Maneuver
from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.frames import cross, level_from_body
from freqid.identify.loads.wrench import AppliedWrench
from freqid.identify.model.line_equations import on_lines
from freqid.identify.regress.equations import real_equations
from freqid.identify.sensors.errors import Reading, error_name, spline_of

HORIZONTAL_WINDS = ("wind north", "wind east")
BIASES = tuple(error_name(n, "bias") for n in ATTITUDE)
SCALES = tuple(error_name(n, "scale") for n in RATES)
_SOURCE = "velocity over the ground less the fitted wind"


@dataclass(frozen=True, eq=False)
class Misaligned:
    """A manoeuvre as it was logged, ready to be brought into line as often as a fit asks for it.

    Attributes
    ----------
    maneuver : Maneuver
    effectors : mapping of str to tuple of str
        Effectors that share a clock, by kind.
    """

    maneuver: Maneuver
    effectors: Mapping[str, tuple[str, ...]]

    @property
    def over_ground(self) -> bool:
        """Tell whether u v w have to be made from velocity over the ground and attitude."""
        record = self.maneuver.record
        known = any(n in record for n in (*VELOCITY, "air/alpha", "air/beta"))
        return not known and all(n in record for n in (*GROUND, *ATTITUDE))

    def clocks(self) -> dict[str, tuple[str, ...]]:
        """Return the channels that come late together, by the name of their delay."""
        record = self.maneuver.record
        velocity = GROUND if self.over_ground else VELOCITY
        groups = {"velocity delay": velocity, "attitude delay": ATTITUDE}
        groups |= {f"{k} delay": tuple(f"effector/{n}" for n in of) for k, of in self.effectors.items()}
        return {name: group for name, group in groups.items() if all(n in record for n in group)}

    def at(self, errors: Mapping[str, float]) -> Maneuver:
        """Return the manoeuvre without errors of these sizes.

        Parameters
        ----------
        errors : mapping of str to float
            Delays of `clocks`, s, biases of the attitude, rad, scale errors of the rates, and wind, m/s;
            zero where absent.

        Returns
        -------
        Maneuver
            On the same samples: a channel brought forward is held over the last stretch.
        """
        record = self.maneuver.record
        changed = {}
        for clock, group in self.clocks().items():
            later = self._late(clock, errors.get(clock, 0.0))
            for name, values in zip(group, later, strict=True):
                true = Reading.of(name, errors, clock).undone(values)
                changed[name] = replace(record.channel(name), values=true)
        for name in RATES:
            if reading := Reading.of(name, errors):
                channel = record.channel(name)
                changed[name] = replace(channel, values=reading.undone(channel.values))
        if self.over_ground:
            turn = level_from_body(np.array([changed[n].values for n in ATTITUDE]))
            wind = [errors.get(n, 0.0) for n in HORIZONTAL_WINDS]
            through = np.array([changed[n].values for n in GROUND]) - np.array([*wind, 0.0])[:, None]
            for name, values in zip(VELOCITY, np.einsum("jin,jn->in", turn, through), strict=True):
                seen = record.channel(GROUND[0])
                changed[name] = Channel(name, "m/s", values, seen.native_rate_hz, _SOURCE, seen.position_m)
        return Maneuver(record.with_channels(*changed.values()), self.maneuver.vehicle)

    @cached_property
    def _late(self) -> Callable[[str, float], tuple[Array, ...]]:
        """Return the channels of a clock, brought forward; the last few are kept."""
        record, clocks = self.maneuver.record, self.clocks()
        splines = {
            name: [spline_of(record.time, record.channel(n)) for n in group] for name, group in clocks.items()
        }

        def late(delay: str, by: float) -> tuple[Array, ...]:
            at = np.clip(record.time + by, record.time[0], record.time[-1])
            return tuple(spline(at) for spline in splines[delay])

        return lru_cache(maxsize=2 * len(clocks))(late)


STEP = 1e-4  # s, rad or 1, for derivatives
# Rounds of Gauss-Newton, each with weights by what the last one leaves: the first holds the delays.
MOTION_ROUNDS = 4


def motion_unknowns(flown: Misaligned) -> tuple[str, ...]:
    """Return what kinematics can tell of a record's clocks: nothing without rates, forces and attitude."""
    record = flown.maneuver.record
    if not all(n in record for n in (*RATES, *FORCES, *ATTITUDE)):
        return ()
    moving = ("velocity delay",) if "velocity delay" in flown.clocks() else ()
    # Through the air attitude only turns gravity; over the ground it turns u v w into each other.
    return (*moving, "attitude delay", *(BIASES if flown.over_ground else ()), *SCALES)


def fit_motion(
    flown: Misaligned,
    lines_hz: Array,
    plausible: Mapping[str, float],
    driven: Callable[[Maneuver], Misaligned | None] | None = None,
) -> tuple[Array, Array]:
    """Estimate `motion_unknowns` on lines.

    Parameters
    ----------
    flown : Misaligned
    lines_hz : ndarray, shape (M,)
        Hz, where the manoeuvre was excited.
    plausible : mapping of str to float
        One sigma of each unknown beforehand, SI units.
    driven : callable, optional
        From a manoeuvre to the same as the injected signals alone would have made it. In gusts a velocity
        through the air is not what accelerometers feel, and the aircraft rides the gusts: then the injected
        signals alone tell how late the velocity is, and rates alone how late the attitude.

    Returns
    -------
    estimate : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)

    Notes
    -----
    With C from body to earth axes and V the velocity of the accelerometers' point,

        ``V' = C f + g``  over the ground,  ``v' = f + C^T g - w x v``  through the air,

    and Euler angles change with the rates. All hold in any steady wind and without aerodynamics, and what is
    left of them on the lines is least at the right delays. Means are not used, so the biases of
    accelerometers and of steady angles do not enter; a bias of the attitude is told by the cross-talk that
    it makes between the axes. Scale errors of the rates, which every moment and every rate's parameter share,
    are those against the attitude. Each equation is weighed by what it leaves.
    """
    names = motion_unknowns(flown)
    sizes = np.array([plausible[n] for n in names])

    def left(unknown: Array, flown: Misaligned = flown) -> Array:
        maneuver = flown.at(dict(zip(names, unknown.tolist(), strict=True)))
        motion = _kinematics(maneuver, ground=flown.over_ground, moving="velocity delay" in names)
        line = np.zeros((1, motion.direct.shape[1]))  # on_lines wants a regressor; nothing is regressed
        equations = on_lines([line], [motion], [maneuver.record.dt], lines_hz)
        ends, rows = real_equations(equations.nuisance, equations.z)
        basis = np.linalg.qr(ends.T)[0]
        return rows - (rows @ basis) @ basis.T

    found: Array = np.zeros(len(names))
    covariance: Array = np.diag(sizes**2)
    prior = np.diag(sizes**-2)
    alone: Misaligned | None = None
    for turn in range(MOTION_ROUNDS if driven is None else 2 * MOTION_ROUNDS):
        if driven is not None and turn >= MOTION_ROUNDS:  # made of what is nearly on time already
            alone = driven(flown.at(dict(zip(names, found.tolist(), strict=True))))
        now = left(found)
        slope = np.array([(left(found + s) - now) / STEP for s in STEP * np.eye(len(names))])
        scale = np.tile(np.sqrt(_noise(now, lines_hz)), (1, 2))
        columns = (slope / scale).reshape(len(names), -1)
        told = columns
        if alone is not None:
            late, nothing = names.index("velocity delay"), np.zeros(len(names))
            step = STEP * np.eye(len(names))[late]
            instruments = slope.copy()
            instruments[:, len(ATTITUDE) :] = 0.0
            instruments[late] = (left(step, alone) - left(nothing, alone)) / STEP
            told = (instruments / scale).reshape(len(names), -1)
        inverse = np.linalg.inv(told @ columns.T + prior).astype(np.float64)
        found = found - inverse @ (told @ (now / scale).ravel() + found / sizes**2)
        covariance = inverse @ (told @ told.T + prior) @ inverse.T
    return found, covariance


def _noise(left: Array, lines_hz: Array) -> Array:
    """Return the power that each equation leaves per real equation, ``a + b f^2``, shape (rows, M).

    Noise of what is differentiated grows with frequency, that of rates and forces does not.
    """
    power = (left[:, : lines_hz.size] ** 2 + left[:, lines_hz.size :] ** 2) / 2
    shape = np.stack([np.ones_like(lines_hz), lines_hz**2], axis=1)
    level = np.empty_like(power)
    for row, own in enumerate(power):
        level[row] = own.mean()
        for _ in range(3):  # powers scatter like their size
            level[row] = shape @ nnls(shape / level[row][:, None], own / level[row])[0]
    return level


def _kinematics(maneuver: Maneuver, *, ground: bool, moving: bool) -> AppliedWrench:
    """Return the equations of motion as ``direct + d(momentum)/dt = 0``."""
    record = maneuver.record
    rates, felt = record.matrix(RATES), record.matrix(FORCES)
    attitude = record.matrix(ATTITUDE)
    (p, q, r), (phi, theta) = rates, attitude[:2]
    across = q * np.sin(phi) + r * np.cos(phi)
    turning = [
        p + across * np.tan(theta),
        q * np.cos(phi) - r * np.sin(phi),
        across / np.cos(theta),
    ]
    direct, momentum = -np.array(turning), attitude
    if moving:
        home = np.array(maneuver.vehicle.mass_properties.cg_m)
        names = GROUND if ground else VELOCITY
        places = [record.channel(n).position_m for n in ("state/ax", names[0])]
        arm = np.subtract(*(home if at is None else np.array(at) for at in places))
        swung = cross(rates, np.broadcast_to(arm[:, None], rates.shape))
        turn = level_from_body(attitude)
        if ground:
            velocity = record.matrix(GROUND) + np.einsum("ijn,jn->in", turn, swung)
            accelerating = -np.einsum("ijn,jn->in", turn, felt)
        else:
            velocity = record.matrix(VELOCITY) + swung
            accelerating = cross(rates, velocity) - felt - STANDARD_GRAVITY * turn[2]
        direct, momentum = np.concatenate([direct, accelerating]), np.concatenate([momentum, velocity])
    rows = len(direct)
    return AppliedWrench(("",) * rows, ("",) * rows, direct, momentum)
