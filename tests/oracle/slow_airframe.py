"""The airframe's wrench once more: plain numpy, loops, points turned one by one into body axes.

Written from the equations of docs/theory/simulation-airframe.md and the scenario file alone; nothing of the
simulation is imported. Momentum theory is solved by bracketing, the lifting line by a solve for the
circulation.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

EX, EY = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def turn(vector: np.ndarray, angle: float) -> np.ndarray:
    matrix = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return matrix @ np.asarray(vector, dtype=float)


class SlowAirframe:
    """One scenario's airframe; `wrench` returns force, moment, torques and what the front wing sheds."""

    def __init__(self, path: Path, strength: dict[str, float] | None = None):
        self.table = tomllib.loads(path.read_text())
        self.air = self.table["simulation"]["airframe"]
        self.strength = {"slipstream": 1.0, "wing_wake": 1.0, "rotor_inplane_force": 1.0} | (strength or {})
        self.surfaces = [e["name"] for e in self.table["effector"] if e["kind"] == "surface"]
        self.pivots = {w["name"]: np.array(w["pivot_m"]) for w in self.table["wing"]}

    # --- rotors -------------------------------------------------------------------------------------------

    def propeller(self, velocity, axis, spin, d, omega, rho):
        """Force and moment at one hub in body axes, and thrust, torque, axial and in-plane velocity."""
        c = self.air["propeller"]
        u = velocity @ axis
        across = velocity - u * axis
        w = np.linalg.norm(across)
        x = omega / (2 * np.pi) * d
        s = np.sqrt(x * x + u * u + 0.01)

        def cubic(k):
            return k[0] * x * x + k[1] * x * u + (k[2] * x * u * u + k[3] * u**3) / s

        thrust = (
            rho * d**2 * (cubic(c["thrust"]) + c["crossflow_thrust"] * (w * x) ** 2 / (x * x + w * w + 0.01))
        )
        torque = rho * d**3 * cubic(c["torque"])
        scale = self.strength["rotor_inplane_force"]
        force = thrust * axis - scale * c["inplane_force"] * rho * d**2 * s * across
        moment = -spin * torque * axis - scale * c["hub_moment"] * spin * rho * d**3 * s * across
        return force, moment, thrust, torque, u, across

    @staticmethod
    def induced(thrust, u, w, area, rho):
        k = thrust / (2 * rho * area)
        climb = u / (1 + np.exp(-2 * u))
        root = lambda v: v * np.sqrt((climb + v) ** 2 + w**2 + 0.01) - k  # noqa: E731
        if k >= 0:
            return brentq(root, 0, 1 + np.sqrt(k) + k, xtol=1e-14, rtol=1e-14)
        lowest = -0.5 * np.sqrt(climb**2 + w**2 + 0.01)
        return brentq(root, lowest, 0, xtol=1e-14, rtol=1e-14)

    # --- sections -----------------------------------------------------------------------------------------

    @staticmethod
    def section(a, slope_of_lift, lift_drag, u, w, incline, cm_surface):
        """Lift, drag and moment coefficients and speed; `incline` turns the zero-lift line."""
        speed = np.sqrt(u * u + w * w + 0.02**2)
        cos, sin = u / speed, w / speed
        attached = 1 / (1 + ((1 - cos) / (1 - np.cos(a["stall_rad"]))) ** 3)
        turned = np.arctan(incline)
        sin0 = sin * np.cos(turned) + cos * np.sin(turned)
        cos0 = cos * np.cos(turned) - sin * np.sin(turned)
        normal = (1 - attached) * a["plate"] * sin0 / (0.44 + 0.56 * abs(sin0))
        lift = attached * slope_of_lift * sin0 + normal * cos0
        drag = a["drag"] + attached * lift_drag * sin0**2 + normal * sin0
        moment = attached * (a["moment"] + cm_surface) - 0.25 * normal * (1 - cos)
        return lift, drag, moment, speed, cos, sin

    def flap(self, fraction):
        h = np.arccos(2 * fraction - 1)
        share = self.air["surface_efficiency"]
        return share * (1 - h / np.pi + np.sin(h) / np.pi), -share * 0.5 * np.sin(h) * (1 - np.cos(h))

    # --- the whole ------------------------------------------------------------------------------------------

    def wrench(self, velocity, rates, rho, surface, tilt, tilt_rate, speed, arriving=None):
        if arriving is None:
            calm = (np.zeros(2), np.zeros(2))
            arriving = self.wrench(velocity, rates, rho, surface, tilt, tilt_rate, speed, calm)[3]
        delta = dict(zip(self.surfaces, surface, strict=True))
        names = list(self.pivots)
        tilt_of, rate_of = dict(zip(names, tilt, strict=True)), dict(zip(names, tilt_rate, strict=True))
        felt = [self.strength["wing_wake"] * np.asarray(part) for part in arriving]
        force, moment, torques = np.zeros(3), np.zeros(3), []

        def motion_at(point, wing):
            v = velocity + np.cross(rates, point)
            if wing is not None:
                v = v + np.cross(rate_of[wing] * EY, point - self.pivots[wing])
            return v

        tubes: dict[str, list] = {name: [] for name in names}
        for rotor, omega in zip(self.table["rotor"], speed, strict=True):
            wing = rotor["wing"]
            hub = self.pivots[wing] + turn(rotor["position_m"] - self.pivots[wing], tilt_of[wing])
            axis, d = turn(EX, tilt_of[wing]), rotor["diameter_m"]
            f, m, thrust, torque, u, across = self.propeller(
                motion_at(hub, wing), axis, rotor["spin"], d, omega, rho
            )
            force, moment = force + f, moment + m + np.cross(hub, f)
            torques.append(torque)
            v = self.induced(thrust, u, np.linalg.norm(across), np.pi * d**2 / 4, rho)
            tubes[wing].append((np.array(rotor["position_m"]), d / 2, u, turn(across, -tilt_of[wing]), v))

        shed = []
        for index, described in enumerate(self.air["wing"]):
            name = described["name"]
            b, n = described["span_m"], self.air["strips"]
            edges = -b / 2 * np.cos(np.pi * np.arange(n + 1) / n)
            ys = -b / 2 * np.cos(np.pi * (np.arange(n) + 0.5) / n)
            chords = [np.interp(abs(y), [0, b / 2], described["chord_m"]) for y in ys]
            line = np.array([described["quarter_chord_m"][0], 0.0, described["quarter_chord_m"][1]])
            a = self.air["aerofoil"]
            along, down = turn(EX, tilt_of[name]), turn([0, 0, 1], tilt_of[name])

            us, ws, inclines, moments = [], [], [], []
            for i in range(n):
                width = edges[i + 1] - edges[i]
                quarter = self.pivots[name] + turn(line + ys[i] * EY - self.pivots[name], tilt_of[name])
                # along the chord the wind is that of the quarter chord, across it of the three-quarter chord
                v_quarter = motion_at(quarter, name)
                v_three = motion_at(quarter - 0.5 * chords[i] * along, name)
                u, w = v_quarter @ along, v_three @ down
                for place, radius, axial, across, v in tubes[name]:
                    s = place[0] - line[0]
                    grown = v * (1 + s / np.sqrt(s**2 + radius**2))
                    floor = across @ across + 0.01
                    reach = radius * (((axial + v) ** 2 + floor) / ((axial + grown) ** 2 + floor)) ** 0.25
                    late = s / np.sqrt((axial + v) ** 2 + floor)
                    mix = self.air["mixing_m"]
                    ramp = lambda x, mix=mix: np.sqrt(x**2 + mix**2)  # noqa: E731
                    left, right = (e - place[1] + late * across[1] for e in (edges[i], edges[i + 1]))
                    wet = (ramp(right + reach) - ramp(right - reach)) - (
                        ramp(left + reach) - ramp(left - reach)
                    )
                    height = line[2] - place[2] + late * across[2]
                    hit = (height + reach) / ramp(height + reach) - (height - reach) / ramp(height - reach)
                    u = u + self.strength["slipstream"] * 0.5 * hit * grown * 0.5 * wet / width
                if index == 1:
                    share = np.clip([-edges[i], edges[i + 1]], 0, width) / width
                    gust = (share @ felt[1]) * EX - (share @ felt[0]) * np.array([0, 0, 1.0])
                    u, w = u + gust @ along, w + gust @ down
                incline, cm = np.tan(-a["zero_lift_rad"]), 0.0
                for flap in self.air["surface"]:
                    if flap["on"] == name:
                        low, high = flap["span_m"]
                        covered = max(0.0, min(high, edges[i + 1]) - max(low, edges[i])) / width
                        angle, moving = self.flap(flap["chord_fraction"])
                        incline += covered * angle * delta[flap["name"]]
                        cm += covered * moving * delta[flap["name"]]
                us.append(u), ws.append(w), inclines.append(incline), moments.append(cm)

            area = sum(c * (edges[i + 1] - edges[i]) for i, c in enumerate(chords))
            geometric = a["stall_rad"] * (1 + a["lift_slope"] * area / (np.pi * b**2))
            driving = np.zeros(n)
            for i in range(n):
                cos = us[i] / np.sqrt(us[i] ** 2 + ws[i] ** 2 + 0.02**2)
                attached = 1 / (1 + ((1 - cos) / (1 - np.cos(geometric))) ** 3)
                turned = np.arctan(inclines[i])
                driving[i] = attached * (us[i] * np.sin(turned) + ws[i] * np.cos(turned))
            # circulation G = c a / 2 (driving - downwash), downwash by horseshoe vortices
            downwash = np.zeros((n, n))
            for i in range(n):
                for j in range(n):
                    downwash[i, j] = (1 / (ys[i] - edges[j]) - 1 / (ys[i] - edges[j + 1])) / (4 * np.pi)
            half = np.array(chords) * a["lift_slope"] / 2
            circulation = np.linalg.solve(np.eye(n) + half[:, None] * downwash, half * driving)
            induced = downwash @ circulation

            bound = np.zeros(n)
            for i in range(n):
                u, w = us[i], ws[i] - induced[i]
                lift, drag, cm, fast, cos, sin = self.section(
                    a, a["lift_slope"], a["lift_drag"], u, w, inclines[i], moments[i]
                )
                q = 0.5 * rho * (u * u + w * w) * chords[i] * (edges[i + 1] - edges[i])
                f = q * (lift * sin - drag * cos) * along - q * (lift * cos + drag * sin) * down
                quarter = self.pivots[name] + turn(line + ys[i] * EY - self.pivots[name], tilt_of[name])
                force = force + f
                moment = moment + np.cross(quarter, f) + q * chords[i] * cm * EY
                bound[i] = 0.5 * chords[i] * fast * lift

            # the wake towards what lies behind
            target = np.array(self.air["wing"][1]["quarter_chord_m"])
            if index == 1:
                target = np.array(self.air["tail"]["centre_m"])[[0, 2]]
            behind = target - np.array(described["quarter_chord_m"])
            out = np.zeros((2, 2))
            for side, (low, high) in enumerate(((-b, 0.0), (0.0, b))):
                mean = sum(
                    bound[i] * max(0.0, min(high, edges[i + 1]) - max(low, edges[i])) for i in range(n)
                ) / (b / 2)
                sink = self.air["wake"]["downwash"] * 4 * mean / (np.pi * b)
                jets = [2 * tube[4] for tube in tubes[name] if (tube[0][1] >= 0) == bool(side)]
                jet = -self.air["wake"]["blowing"] * np.mean(jets) * along
                wind = np.array([-velocity[0] + jet[0], -velocity[2] + jet[2] + sink])
                fast = np.sqrt(wind @ wind + 0.25)
                miss = (behind[0] * wind[1] - behind[1] * wind[0]) / fast
                ahead = wind @ behind / fast / np.linalg.norm(behind)
                reach = np.exp(-((miss / self.air["wake"]["depth_m"]) ** 2)) / (1 + np.exp(-8 * ahead))
                out[:, side] = reach * (sink + jet[2]), -reach * jet[0]
            shed.append(out)

        body = self.air["fuselage"]
        centre = np.array(body["centre_m"])
        v = velocity + np.cross(rates, centre)
        f = -0.5 * rho * np.sqrt(v @ v + 0.02**2) * np.array(body["drag_area_m2"]) * v
        force, moment = force + f, moment + np.cross(centre, f)
        moment = moment + rho * body["volume_m3"] * v[0] * np.array([0, v[2], -v[1]])

        tail = self.air["tail"]
        a, aspect = tail["aerofoil"], tail["span_m"] / tail["chord_m"]
        slope = a["lift_slope"] / (1 + a["lift_slope"] / (np.pi * aspect))
        for side, panel in enumerate(("tail-left", "tail-right")):
            sign = 2 * side - 1
            centre = np.array(tail["centre_m"]) * [1, sign, 1]
            up = np.array([0, -sign * np.sin(tail["dihedral_rad"]), -np.cos(tail["dihedral_rad"])])
            wash = [felt[k][side] + self.strength["wing_wake"] * shed[1][k, side] for k in (0, 1)]
            v = velocity + np.cross(rates, centre) + np.array([wash[1], 0, -wash[0]])
            u, w = v[0], -v @ up
            incline, cm = np.tan(tail["incidence_rad"] - a["zero_lift_rad"]), 0.0
            for flap in self.air["surface"]:
                if flap["on"] == panel:
                    angle, moving = self.flap(flap["chord_fraction"])
                    incline, cm = incline + angle * delta[flap["name"]], cm + moving * delta[flap["name"]]
            lift, drag, cm, fast, cos, sin = self.section(
                a, slope, a["lift_drag"] + slope**2 / (np.pi * aspect), u, w, incline, cm
            )
            q = 0.5 * rho * (u * u + w * w) * tail["span_m"] * tail["chord_m"]
            f = q * (lift * sin - drag * cos) * EX + q * (lift * cos + drag * sin) * up
            force, moment = force + f, moment + np.cross(centre, f)
            moment = moment + q * tail["chord_m"] * cm * np.cross(EX, up)

        return force, moment, np.array(torques), (shed[0][0], shed[0][1])
