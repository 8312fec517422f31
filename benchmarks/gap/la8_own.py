"""Truths by the library's own formulas."""

from __future__ import annotations

from truth import Settings, Truth


def _own(identifier: str, one: float, most: float, *places: str, parameter: str = "") -> Truth:
    """Return an effect by its own formula; a place is a parameter, with a minus for one that is lowered."""

    def settings(size: float, place: str) -> Settings:
        sign = -1.0 if place.startswith("-") else 1.0
        return {identifier: {place.lstrip("-") or parameter: sign * size}}

    return Truth(identifier, "own", one, most, places or ("",), settings)


def _strength(identifier: str, one: float, most: float = 1.0) -> Truth:
    return _own(identifier, one, most, "strength", "-strength")


OWN = (
    _own("actuator_delay", 0.01, 0.078, "extra"),
    _own("actuator_lag", 0.01, 0.5, "extra"),
    _own("motor_lag", 0.02, 0.5, "extra"),
    _own("rate_limit", 3.0, 30.0, "slowness"),
    _own("backlash", 0.02, 0.2, "width"),
    _own("surface_effectiveness", 0.1, 0.95, "loss", "de1", "df4", "de3", "dr2"),
    _own("weak_rotor", 0.05, 0.6, "loss", "n1", "n3", "n6", "n8"),
    _strength("slipstream", 0.2),
    _strength("rotor_inplane_force", 0.5, 3.0),
    _own("battery_sag", 0.5, 5.0, "strength"),
    _strength("gyroscopic", 0.5, 8.0),
    _strength("wing_wake", 0.2),
    _own("downwash_lag", 0.2, 5.0, "strength"),
    _own("stall", 0.3, 3.0, "strength"),
    _own("unsteady_lift", 0.03, 0.6, "time_constant"),
    _own("extra_drag", 0.02, 1.0, "coefficient"),
    _own("mass", 0.05, 0.5, "fraction", "-fraction"),
    _own("cg_offset", 0.02, 0.15, "x", "-x", "y", "z"),
    _own("inertia", 0.1, 0.9, "xx", "yy", "-yy", "zz"),
    _own("tilt_inertia", 0.2, 0.9, "fraction", "-fraction"),
    _own("flexible_mode", 0.05, 2.0, "strength"),
    _own("sensor_bias", 0.05, 5.0, "p", "q", "theta", "w", "u", "surface"),
    _own("sensor_scale", 0.03, 0.9, "az", "q", "p", "u", "surface", "theta"),
    _own("time_skew", 0.01, 0.2, "velocity", "rates", "accelerometers", "attitude", "effectors"),
    _own("lever_arm", 0.05, 1.0, "x", "-y", "z"),
    _own("flow_upwash", 0.05, 0.9, "alpha", "-alpha", "beta"),
    _own("misalignment", 0.02, 0.5, "imu_x", "imu_y", "imu_z", "velocity_y", "velocity_z"),
    _own("steady_wind", 1.0, 12.0, "north", "-north", "east", "down"),
)
