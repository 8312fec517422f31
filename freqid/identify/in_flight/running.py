"""Parameters in flight: raw samples in, estimates out, each in a time that does not grow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError, nearest
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.sections.identification import Identification, factors_of
from freqid.core.vehicle import Vector, Vehicle
from freqid.identify.in_flight.recursive import RecursiveRegression, RunningEstimate
from freqid.identify.loads.wrench import applied_wrench

MOTION = ("p", "q", "r", "ax", "ay", "az")


class InFlight:
    """Equation error on the samples of a flight computer, tilting wings held at one reference condition.

    Parameters
    ----------
    vehicle : Vehicle
    settings : Identification
        Form "force", body axes, reconstructed responses, method "frequency".
    dt : float
        Sampling interval, s.
    frequencies_hz : array_like, shape (M,)
        Lines of the regression, Hz.
    tilt_rad : mapping of str to float, optional
        Angle by tilt effector that the wings are held at, rad; where the stated mass properties hold
        where absent.
    accelerometer_m : tuple of 3 floats, optional
        Position of the accelerometers, vehicle axes, m; the centre of gravity where absent.

    Attributes
    ----------
    channels : tuple of str, length c
        What `update` expects, in this order: ``p q r ax ay az``, then regressors, velocities and flow
        angles those of the centre of gravity, and rotors.

    Raises
    ------
    UsageError
        The settings ask for what needs the whole record, or a tilt is unknown.

    Notes
    -----
    With wings held, momentum is a constant matrix times rates and rotor speeds, and what is direct follows
    from it: ``m a + w x m v`` for forces, ``w x H`` for moments (docs/theory/recursive.md, eqs. 4 and 5).
    The matrix is taken from `applied_wrench` itself, column by column.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        settings: Identification,
        dt: float,
        frequencies_hz: ArrayLike,
        *,
        tilt_rad: Mapping[str, float] | None = None,
        accelerometer_m: Vector | None = None,
    ):
        for key, possible in (
            ("form", "force"),
            ("axes", "body"),
            ("response_source", "reconstruct"),
            ("angular_acceleration", "transform"),
        ):
            if getattr(settings, key) != possible:
                raise UsageError(
                    f"{key} is '{getattr(settings, key)}', expected '{possible}' in flight",
                    remedy="identify the whole record for the other",
                )
        products = [
            n for r in settings.responses for n in settings.regressors_of(r) if len(factors_of(n)) > 1
        ]
        if products:
            raise UsageError(
                f"regressor '{products[0]}' is a product, which is not estimated in flight",
                remedy="identify the whole record for it",
            )
        self._regression = RecursiveRegression(settings, dt, frequencies_hz)
        rotors = tuple(r.name for r in vehicle.rotors if r.inertia)
        self.channels = tuple(dict.fromkeys((*MOTION, *self._regression.names, *rotors)))
        self._mass = vehicle.mass_properties.mass_kg
        self._regressors = np.array([self.channels.index(n) for n in self._regression.names])
        self._spinning = np.array([self.channels.index(n) for n in ("p", "q", "r", *rotors)])
        self._rows = np.array([WRENCH.index(r) for r in settings.responses])
        self._momentum = _momentum_matrix(vehicle, rotors, tilt_rad or {}, accelerometer_m)

    def update(self, sample: ArrayLike) -> None:
        """Take in one sample.

        Parameters
        ----------
        sample : array_like, shape (c,)
            Values of `channels`, SI units.

        Raises
        ------
        DataError
            A value is not finite; the sample is then not taken in.
        UsageError
            The number of values is wrong.
        """
        y = np.asarray(sample, dtype=float)
        if y.shape != (len(self.channels),):
            raise UsageError(f"a sample has shape {y.shape}, expected one value each of {self.channels}")
        momentum = self._momentum @ y[self._spinning]
        # Component by component: on single vectors that is several times faster than array products.
        (p, q, r, ax, ay, az), m = y[:6].tolist(), self._mass
        bx, by, bz, hx, hy, hz = momentum.tolist()
        direct = np.array(
            [
                m * ax + q * bz - r * by,
                m * ay + r * bx - p * bz,
                m * az + p * by - q * bx,
                q * hz - r * hy,
                r * hx - p * hz,
                p * hy - q * hx,
            ]
        )
        self._regression.update(
            y[self._regressors, None], direct[self._rows, None], momentum[self._rows, None]
        )

    def estimate(self) -> dict[str, RunningEstimate]:
        """Return the estimates from the samples so far, by response; DataError while they do not suffice."""
        return self._regression.estimate()


def _momentum_matrix(
    vehicle: Vehicle, rotors: tuple[str, ...], tilts: Mapping[str, float], position: Vector | None
) -> Array:
    """Return d(momentum)/d(p, q, r, rotor speeds), shape (6, 3 + rotors): the wrench of unit motions."""
    held = {w.tilt: vehicle.tilt_rad.get(w.name, 0.0) for w in vehicle.wings}
    for name in tilts:
        if name not in held:
            raise UsageError(f"no wing tilts by '{name}'", remedy=nearest(name, held))
    held |= tilts
    count = 3 + len(rotors)
    time = np.arange(count + 8.0)  # eight more than unit motions, enough to differentiate the still tilts
    unit = np.eye(time.size)
    rows = {f"state/{n}": unit[i] for i, n in enumerate("pqr")}
    rows |= {f"effector/{n}": unit[3 + i] for i, n in enumerate(rotors)}
    rows |= {f"effector/{n}": np.full(time.size, angle) for n, angle in held.items()}
    rows |= {f"state/a{n}": np.zeros(time.size) for n in "xyz"}
    channels = {n: Channel(n, "", v, 1.0, "unit motion", position) for n, v in rows.items()}
    return applied_wrench(Maneuver(FlightRecord(time, channels), vehicle)).momentum[:, :count]
