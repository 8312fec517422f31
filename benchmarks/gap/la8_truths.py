"""What the LA-8 flies: effects of the library, the same physics by other formulas, and none of them."""

from __future__ import annotations

from la8_descriptions import (
    as_stated,
    cut_surface,
    damped_servos,
    factors,
    icing,
    limits_apart,
    moved_accelerometer,
    slow_motors,
    stop,
    uneven_spin,
    uneven_wings,
)
from la8_loads import flown_as
from la8_own import OWN
from log_truths import SKEWED, bending, compressed, hysteresis, shaken_gyro, skewed
from truth import Truth

OTHER = (
    Truth("actuator_delay", "by kind", 1.0, 12.0, settings=flown_as("actuator_delay", "strength")),
    Truth("actuator_lag", "damped", 0.01, 0.5, scenario=damped_servos),
    Truth("motor_lag", "slower", 0.02, 0.5, scenario=slow_motors),
    Truth("rate_limit", "apart", 3.0, 30.0, scenario=limits_apart),
    Truth("surface_effectiveness", "cut", 0.15, 0.95, ("de2", "df1", "df3", "de4"), scenario=cut_surface),
    Truth("weak_rotor", "worn", 0.05, 0.6, ("n2", "n4", "n5", "n7"), settings=flown_as("case_worn", "loss")),
    Truth("slipstream", "blown", 0.2, 2.0, ("", "-strength"), settings=flown_as("case_blown", "strength")),
    Truth(
        "rotor_inplane_force",
        "uneven",
        0.5,
        6.0,
        scenario=factors(
            "airframe", lambda k: {"propeller.inplane_force": 1 + k, "propeller.hub_moment": 1 + 0.6 * k}
        ),
    ),
    Truth(
        "battery_sag",
        "resistance",
        0.5,
        8.0,
        scenario=factors("actuators", lambda k: {"battery.resistance_ohm": 1 + k}),
    ),
    Truth("gyroscopic", "uneven", 0.5, 8.0, scenario=uneven_spin),
    Truth(
        "wing_wake",
        "uneven",
        0.2,
        0.95,
        ("", "-"),
        scenario=factors(
            "airframe",
            lambda k: {"wake.downwash": 1 + 1.2 * k if k > 0 else 1 + k, "wake.blowing": 1 + 0.6 * k},
        ),
    ),
    Truth("downwash_lag", "two lags", 0.2, 5.0, settings=flown_as("case_late", "strength")),
    Truth("stall", "kirchhoff", 0.3, 3.0, settings=flown_as("case_kirchhoff", "strength")),
    Truth("unsteady_lift", "jones", 1.0, 12.0, settings=flown_as("case_jones", "share")),
    Truth(
        "extra_drag",
        "fuselage",
        0.4,
        20.0,
        scenario=factors(
            "airframe", lambda k: {"fuselage.drag_area_m2": (1 + k, 1 + 0.15 * k, 1 + 0.13 * k)}
        ),
    ),
    Truth("tilt_inertia", "uneven", 0.2, 0.7, ("", "-"), scenario=uneven_wings),
    Truth("flexible_mode", "softer", 0.05, 2.0, record=bending),
    Truth("time_skew", "pade", 0.01, 0.2, (*SKEWED, "effectors"), record=skewed),
    Truth("sensor_scale", "compressed", 0.05, 0.9, ("az", "q", "p", "surface"), record=compressed),
    Truth("lever_arm", "moved", 0.05, 1.0, ("x", "y", "z"), scenario=moved_accelerometer, record=as_stated),
)

OUTSIDE = (
    Truth("outside_icing", "other", 0.2, 1.5, scenario=icing),
    Truth("outside_slosh", "other", 1.0, 20.0, settings=flown_as("case_slosh", "mass")),
    Truth("outside_fin", "other", 0.05, 1.0, settings=flown_as("case_fin", "area")),
    Truth("outside_stop", "other", 25.0, 90.0, ("de1", "df2", "de4"), scenario=stop),
    Truth("outside_shaken_gyro", "other", 0.002, 0.1, record=shaken_gyro),
    Truth("outside_hysteresis", "other", 0.01, 0.2, record=hysteresis),
)


def find(identifier: str, form: str) -> Truth:
    """Return one truth."""
    return next(t for t in (*OWN, *OTHER, *OUTSIDE) if (t.id, t.form) == (identifier, form))
