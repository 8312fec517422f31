"""The owner's simulation of the judging blown wing: half wings from a tunnel, a table of propellers."""

from __future__ import annotations

import csv
import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import blownwing_numbers as g  # noqa: E402
from owner import RESPONSES, Owner  # noqa: E402

# Of one half of the wing in its own flow; the last of its own jet
INPUTS = ("camber", "tilt", "alpha", "q", "polar", "section", "inner", "outer", "open", "swirl")
INPUTS += ("roll", "p", "beta", "slip", "r", "1", "jet")
_SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
HUBS = [(tuple(r["position_m"]), r["spin"]) for r in _SCENARIO["rotor"]]
DISC = 3.14159265 * g.PROP_R * g.PROP_R


def _read():
    """Return terms of the half wing and of every propeller's station by response, and the stand's table.

    A term is the index of each of its two inputs and its coefficient.
    """
    wing = {name: [[] for _ in range(5)] for name in RESPONSES}
    table = {"thrust": [], "torque": []}
    for row in csv.DictReader((HERE / "tunnel.csv").read_text().splitlines()):
        value = float(row["coefficient"])
        if row["station"] == "stand":
            table[row["response"]].append((float(row["term"]), value))
            continue
        first, second = (INPUTS.index(n) for n in (*row["term"].split(), "1")[:2])
        station = 0 if row["station"] == "half" else int(row["station"])
        wing[row["response"]][station].append((first, second, value))
    return [wing[n] for n in RESPONSES], {n: np.array(rows).T for n, rows in table.items()}


WING, STAND = _read()
_ADVANCES = STAND["thrust"][0].tolist()
FIRST, STEP, LAST = _ADVANCES[0], _ADVANCES[1] - _ADVANCES[0], len(_ADVANCES) - 2
THRUST, TORQUE = (STAND[end][1].tolist() for end in ("thrust", "torque"))


def loads(m, state, effector, rho, par):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy)."""
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    pressure = 0.5 * rho * speed * speed * g.AREA
    alpha, beta = m.atan2(w, u), v / speed
    inner, outer, opened = (
        [effector[i + k] * (1 + get(g.SURFACES[i + k] + ".effectiveness", 0.0)) for k in (0, 1)]
        for i in (0, 2, 4)
    )
    X = Y = Z = L = M = N = 0.0
    # propellers, from the left tip to the right one
    jets = []
    scale = (1 + get("jets.strength", 0.0)) / (DISC * rho * speed * speed)
    for ((_, y, z), spin), name, n in zip(HUBS, g.ROTORS, effector[6:], strict=True):
        advance = (u + q * z - r * y) * (1 + get("props.advance", 0.0)) / (g.PROP_R * n)
        thrust, torque = _of_stand(advance)
        power = rho * DISC * (g.PROP_R * n) * (g.PROP_R * n)
        thrust = power * thrust * (1 + get(name + ".thrust", 0.0))
        torque = power * g.PROP_R * torque * (1 + get(name + ".torque", 0.0))
        jets.append(thrust * scale)
        X, L, M, N = X + thrust, L - spin * torque, M + z * thrust, N - y * thrust
    # each half of the wing as if it were the right one
    bank, slip = p / speed * (1 + get("wing.roll_damping", 0.0)), beta * (1 + get("wing.sideslip", 0.0))
    found = [0.0] * 6
    for k, sign, own in ((0, -1.0, jets[3::-1]), (1, 1.0, jets[4:])):
        inputs = [
            1 + get("wing.lift_zero", 0.0),
            alpha,
            alpha * (1 + get("wing.lift_slope", 0.0)),
            q / speed * (1 + get("wing.pitch_damping", 0.0)),
            1 + get("wing.drag_zero", 0.0),
            1 + get("wing.moment", 0.0),
            inner[k],
            outer[k],
            opened[k],
            1 + get("jets.swirl", 0.0),
            sign * p / speed,
            sign * bank,
            sign * beta,
            sign * slip,
            sign * r / speed,
            1.0,
            0.0,
        ]
        for at, terms in enumerate(WING):
            total = _sum(terms[0], inputs)
            for jet, of_jet in zip(own, terms[1:], strict=True):
                inputs[-1] = jet
                total = total + jet * _sum(of_jet, inputs)
            found[at] = found[at] + (sign * total if at in (1, 3, 5) else total)
    X, Y, Z = X + pressure * found[0], Y + pressure * found[1], Z + pressure * found[2]
    L, M, N = L + pressure * found[3], M + pressure * found[4], N + pressure * found[5]
    # pod and nacelles
    X = X - 0.0085 * pressure
    Z = Z - 0.0085 * pressure * alpha
    M = M + pressure * g.CHORD * 0.0697 * (1 + get("body.pitch_moment", 0.0)) * alpha
    Y = Y - pressure * (0.0085 + 0.1365 * (1 + get("body.side_force", 0.0))) * beta
    N = N - pressure * g.SPAN * 0.003 * (1 + get("body.yaw_moment", 0.0)) * beta
    return X, Y, Z, L, M, N


def _of_stand(advance):
    """Return thrust and torque coefficients by straight lines over the table's equal steps."""
    at = (advance - FIRST) / STEP
    if isinstance(at, float):  # in flight; numpy takes ten times as long for one number
        k = min(max(int(at), 0), LAST)
        thrust, torque = THRUST, TORQUE
    else:
        k = np.clip(at.astype(int), 0, LAST)
        thrust, torque = STAND["thrust"][1], STAND["torque"][1]
    part = at - k
    return tuple(c[k] + part * (c[k + 1] - c[k]) for c in (thrust, torque))


def _sum(terms, inputs):
    """Return a polynomial of products of two inputs."""
    total = 0.0
    for i, j, c in terms:
        total = total + c * inputs[i] * inputs[j]
    return total


def schedule(u):
    """Return commands that speed alone decides: drag rudders stand open by a third of a radian."""
    return (0.0, 0.0, 0.0, 0.0, 0.35, 0.35, *((800.0,) * 8))


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("outer_l", "outer_r"), g.ROTORS),
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)
