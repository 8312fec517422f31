"""What can be measured on the ground, or in a calm hour, to tell effects apart that flights cannot.

Each test determines parameters of effects directly. One standard error is what instruments of the class
named give in careful hands: assumed, to an order of magnitude, unless the source says it. Procedures:
R. C. Wolowicz, R. B. Yancey, *Experimental Determination of Airplane Mass and Inertial Characteristics*,
NASA TR R-433, 1974; M. R. Jardin, E. R. Mueller, "Optimized Measurements of Unmanned-Air-Vehicle Mass Moment
of Inertia with a Bifilar Pendulum", Journal of Aircraft 46(3), 2009; D. H. Titterton, J. L. Weston,
*Strapdown Inertial Navigation Technology*, IET, 2004, ch. 8 (calibration of inertial sensors); E. A. Haering,
*Airdata Measurement and Calibration*, NASA TM-104316, 1995 (runs of opposite heading); R. H. Scanlan,
R. Rosenbaum, *Introduction to the Study of Aircraft Vibration and Flutter*, Macmillan, 1951.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from freqid.gap.next.rivals import RivalExplanations


@dataclass(frozen=True)
class GroundTest:
    """One test.

    Attributes
    ----------
    id : str
    how : str
        What is done, in a phrase.
    instrument : str
        What the standard errors stand for.
    sigma : dict of float
        One standard error by effect id, for all its parameters, or by ``effect:parameter``; unit of the
        parameter.
    """

    id: str
    how: str
    instrument: str
    sigma: Mapping[str, float]

    def error(self, effect: str, parameter: str) -> float | None:
        """Return one standard error of a parameter; None where the test says nothing of it."""
        return self.sigma.get(f"{effect}:{parameter}", self.sigma.get(effect))


TESTS: tuple[GroundTest, ...] = (
    GroundTest(
        "actuator bench",
        "step and sweep each servo, tilt drive and motor on the bench, its position sensed from outside",
        "14-bit encoder or laser at 1 kHz, on one clock with the command and the log",
        {
            "actuator_delay": 0.001,
            "actuator_lag": 0.002,
            "motor_lag": 0.003,
            "rate_limit": 0.05,
            "backlash": 0.0009,
            "time_skew:effectors": 0.001,
            "sensor_bias:surface": 0.001,
            "sensor_bias:tilt": 0.001,
            "sensor_bias:rotor": 0.2,
        },
    ),
    GroundTest(
        "weighing",
        "weigh the aircraft as flown",
        "load cells of 0.1 %",
        {"mass": 0.001, "mass_properties:fraction": 0.001},
    ),
    GroundTest(
        "balancing",
        "balance it on knife edges or three load cells, level, nose up and on its side",
        "load cells of 0.1 % and a tape",
        {"cg_offset": 0.002} | {f"mass_properties:{axis}": 0.002 for axis in "xyz"},
    ),
    GroundTest(
        "inertia swing",
        "swing it as a bifilar pendulum about each axis, wings at two tilts where they tilt",
        "period to 0.1 %, air moved along corrected for",
        {
            "inertia": 0.02,
            "inertia:xz": 0.01,
            "mass_properties:xx": 0.02,
            "mass_properties:yy": 0.02,
            "mass_properties:zz": 0.02,
            "mass_properties:xz": 0.01,
            "tilt_inertia": 0.05,
        },
    ),
    GroundTest(
        "rotor swing",
        "swing a propeller with its motor bell on two threads",
        "period to 0.5 %",
        {"gyroscopic": 0.03},
    ),
    GroundTest(
        "thrust stand",
        "run each propulsor on a load cell over speed and voltage",
        "load cell of 0.5 %, optical tachometer, supply of the battery's voltage",
        {"weak_rotor": 0.01, "battery_sag": 0.05, "motor_lag": 0.01},
    ),
    GroundTest(
        "hover at heights",
        "hover tethered, or run on a stand, at several heights above a plate",
        "speeds at the same load to 0.5 %",
        {"ground_effect": 0.05, "weak_rotor:loss": 0.02},
    ),
    GroundTest(
        "blown wing",
        "hold the aircraft on load cells and run its propellers, surfaces deflected one by one",
        "load cells of 0.5 %, repeats",
        {"slipstream": 0.05, "surface_effectiveness": 0.05},
    ),
    GroundTest(
        "wind tunnel",
        "propeller, wing or whole aircraft on a balance in a wind tunnel",
        "balance of 0.5 %, flow of 0.5 %, corrected for walls",
        {
            "rotor_inplane_force": 0.05,
            "slipstream": 0.05,
            "wing_wake": 0.05,
            "stall": 0.05,
            "stall:onset": 0.01,
            "extra_drag": 0.002,
            "surface_effectiveness": 0.03,
            "flow_upwash": 0.01,
        },
    ),
    GroundTest(
        "sensor rig",
        "turn the inertial sensors through six positions and on a rate table, swing them beside an encoder",
        "levels of 0.1 mrad, rate table of 0.1 %, encoder at 1 kHz",
        {
            **dict.fromkeys((f"sensor_bias:{n}" for n in ("ax", "ay", "az")), 0.01),
            **dict.fromkeys((f"sensor_bias:{n}" for n in "pqr"), 0.0005),
            **dict.fromkeys((f"sensor_bias:{n}" for n in ("phi", "theta")), 0.001),
            "sensor_bias:psi": 0.02,
            **dict.fromkeys((f"sensor_scale:{n}" for n in ("ax", "ay", "az", "p", "q", "r")), 0.002),
            "sensor_scale:theta": 0.005,
            **dict.fromkeys((f"misalignment:imu_{n}" for n in "xyz"), 0.001),
            **dict.fromkeys((f"time_skew:{n}" for n in ("rates", "accelerometers", "attitude")), 0.001),
        },
    ),
    GroundTest(
        "survey",
        "survey where and how the sensors are mounted",
        "laser tracker, or tape and inclinometer with five times the error",
        {"lever_arm": 0.001, "misalignment": 0.002},
    ),
    GroundTest(
        "ground vibration test",
        "shake the aircraft on soft springs, accelerometers along wings and fuselage",
        "modal test",
        {"flexible_mode": 0.02, "flexible_mode:frequency": 0.05, "flexible_mode:damping": 0.005},
    ),
    GroundTest(
        "opposite headings",
        "fly steady runs on opposite headings in calm air, at several speeds and sideslips",
        "ground velocity of 0.1 m/s, ten runs",
        {
            "steady_wind": 0.1,
            **dict.fromkeys((f"sensor_bias:{n}" for n in "uvw"), 0.1),
            **dict.fromkeys((f"sensor_scale:{n}" for n in "uvw"), 0.01),
            "flow_upwash": 0.02,
            "misalignment:velocity_x": 0.01,
            "misalignment:velocity_y": 0.01,
            "misalignment:velocity_z": 0.01,
        },
    ),
    GroundTest(
        "wind mast",
        "log the wind on a mast beside the flight",
        "sonic anemometer, 0.5 m/s for the distance",
        {"steady_wind": 0.5, "turbulence": 0.5},
    ),
    GroundTest(
        "air-data step",
        "step the pressure at the probe beside a fast transducer",
        "transducer at 1 kHz",
        {"time_skew:velocity": 0.003},
    ),
)
"""Tests, the simplest first."""

UNTESTABLE: dict[str, str] = {
    "unsteady_lift": "only an oscillating wing in a wind tunnel shows it",
    "downwash_lag": "only an oscillating model in a wind tunnel shows it",
}
"""Why no test of the table determines an effect."""


def distance(
    test: GroundTest, rivals: RivalExplanations, pair: tuple[str, str], tolerances: Mapping[str, float]
) -> tuple[float, tuple[str, ...]]:
    """Return how far a test sets two effects apart, and what it measures of them.

    Where one of the two is true the test finds its parameter at the estimate, where the other is, at what is
    stated: the squared difference over the variance of instrument and tolerance, on the scale of
    ``lambda (1 - c^2)``, is added to what flights say. An effect of one size counts once, by whichever
    of its parameters is measured best.

    Parameters
    ----------
    test : GroundTest
    rivals : RivalExplanations
    pair : tuple of str
        Effect ids.
    tolerances : dict of float
        One sigma by name, of `freqid.gap.model.tolerance.stated`.
    """
    total: float = 0.0
    measured: list[str] = []
    for name in pair:
        each: dict[str, float] = {}
        for parameter, value in rivals.sizes(name).items():
            error = test.error(name, parameter)
            if error is not None:
                allowed = tolerances.get(f"{name}.{parameter}", tolerances.get(name, 0.0))
                each[f"{name} {parameter}"] = value**2 / (error**2 + allowed**2)
        if each and rivals.candidate(name).kind == "scalar":
            best = max(each, key=lambda n: each[n])
            each = {best: each[best]}
        total += sum(each.values())
        measured += each
    return total, tuple(measured)
