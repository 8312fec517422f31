"""Derivatives of coefficients about one instant of a flight: what a local identification should find."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.dynamics.frames import stability_from_body
from freqid.simulate.loads import airframe
from freqid.simulate.loads.quantities import Flow
from freqid.simulate.motion import multibody
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind
from freqid.simulate.motion.attitude import cross
from freqid.simulate.motion.derivatives import split

MOTION = ("V", "alpha", "beta", "phat", "qhat", "rhat")
BIAS = "bias"
_HIGH = 1000.0  # m above ground, out of its effect


def local_coefficients(
    scenario: Scenario, truth: FlightRecord, axes: str = "stability"
) -> dict[str, dict[str, float]]:
    """Differentiate the loads at the mean state and effectors of a stretch of flight.

    Parameters
    ----------
    scenario : Scenario
        That was flown.
    truth : FlightRecord
        Of a steady stretch, such as the trim before a manoeuvre, or of a whole manoeuvre.
    axes : {"stability", "body"}
        Of forces and moments; stability axes are those of the mean angle of attack.

    Returns
    -------
    dict of dict of float
        By response X to N and regressor: ``V alpha beta phat qhat rhat`` and effectors. Derivatives by V are
        at held rotor speeds. ``bias`` is the coefficient where all of them but V and the rotor speeds are
        zero, on the tangent.

    Raises
    ------
    UsageError
        Where the vehicle states no reference area, span or chord.
    """
    vehicle = scenario.aircraft()
    if vehicle.area_m2 is None or vehicle.span_m is None or vehicle.chord_m is None:
        raise UsageError("coefficients need area_m2, span_m and chord_m", remedy="add them to [vehicle]")
    area, span, chord = vehicle.area_m2, vehicle.span_m, vehicle.chord_m
    parameters = jax.device_put(motion.parameters(scenario))
    names = (*MOTION, *(e.name for e in vehicle.effectors))
    mean = {f"air/{n}": float(truth[f"air/{n}"].mean()) for n in ("V", "alpha", "beta", "rho")}
    rates = [float(truth[f"state/{n}"].mean()) for n in "pqr"]
    places = by_kind(vehicle, np.arange(len(vehicle.effectors)))
    speed, alpha = mean["air/V"], mean["air/alpha"]
    lengths = np.array([span, chord, span])
    at = np.array(
        [
            speed,
            alpha,
            mean["air/beta"],
            *rates,
            *(float(truth[f"effector/{e.name}"].mean()) for e in vehicle.effectors),
        ]
    )
    turn = stability_from_body(alpha) if axes == "stability" else np.eye(3)
    order = np.concatenate([np.asarray(part) for part in places])
    body, slopes_of_body = _body_axes(
        parameters, jnp.asarray(at[: len(MOTION)]), jnp.asarray(at[len(MOTION) :][order]), mean["air/rho"]
    )
    slopes_of_body = np.array(slopes_of_body, dtype=float)
    slopes_of_body[:, len(MOTION) + order] = slopes_of_body[:, len(MOTION) :].copy()
    # loads to coefficients, and the dynamic pressure that goes with V
    scale = 0.5 * mean["air/rho"] * speed**2 * area * np.concatenate([np.ones(3), lengths])
    whole = np.kron(np.eye(2), turn)
    values = whole @ np.asarray(body) / scale
    slopes = whole @ slopes_of_body / scale[:, None]
    slopes[:, 0] -= 2 / speed * values
    slopes[:, 3:6] *= 2 * speed / lengths
    slopes[:, 0] += (
        slopes[:, 3:6] @ (at[3:6] * lengths / (2 * speed)) / speed
    )  # rates go with V at held phat, qhat, rhat
    linear = [i for i, n in enumerate(names) if n != "V" and vehicle.effector_kinds.get(n) != "rotor"]
    at[3:6] *= lengths / (2 * speed)
    bias = values - slopes[:, linear] @ at[linear]
    return {response: {BIAS: float(bias[i]), **_row(names, slopes[i])} for i, response in enumerate(WRENCH)}


@jax.jit
def _body_axes(
    parameters: motion.Parameters, moving: jax.Array, effectors: jax.Array, rho: float
) -> tuple[jax.Array, jax.Array]:
    """Return X Y Z L M N and their derivatives by V alpha beta p q r and effectors by kind."""

    def of(x: jax.Array) -> jax.Array:
        v, a, b = x[0], x[1], x[2]
        velocity = v * jnp.stack([jnp.cos(a) * jnp.cos(b), jnp.sin(b), jnp.sin(a) * jnp.cos(b)])
        positions = split(parameters, x[len(MOTION) :])
        centre = multibody.traced_centre_of_gravity(parameters.mass, positions.tilt)
        flow = Flow(velocity - cross(x[3:6], centre), x[3:6], jnp.asarray(rho), jnp.asarray(_HIGH))
        return airframe.wrench(parameters.airframe, flow, positions).wrench.about(centre)

    x = jnp.concatenate([moving, effectors])
    return of(x), jax.jacfwd(of)(x)


def _row(names: tuple[str, ...], slopes: np.ndarray) -> Mapping[str, float]:
    return dict(zip(names, map(float, slopes), strict=True))
