"""Effects of one's own for ``--effects``, of a small multicopter whose simulation knows only its commands."""

import numpy as np

from freqid.simulate.effects.effect import Effect, Parameter


def _commanded(replay):
    """Return the force along z that the simulation makes of the commands."""
    return replay.simulation.predict(replay.record)[replay.simulation.responses.index("Z")]


def _sag(settings, replay):
    """Motors turn in proportion to the measured battery voltage, thrust goes with the square of that."""
    voltage = replay.record["power/voltage"]
    ratio = 1 + settings["share"] * (voltage / settings["nominal"] - 1)
    return {"Z": _commanded(replay) * (ratio**2 - 1)}


def _measured(settings, replay):
    """Thrust is what measured speeds make, not what commands do."""
    record = replay.record
    speeds = record.matrix(f"effector/n{i}" for i in (1, 2, 3, 4))
    thrust = settings["thrust_constant"] * (speeds**2).sum(axis=0)
    return {"Z": settings["share"] * (-_commanded(replay) - thrust)}


def _drag(settings, replay):
    """Rotors in a cross flow hold back in proportion to their speed and the flow's (Mahony et al., 2012)."""
    record = replay.record
    speeds = np.sum([record[f"effector/n{i}"] for i in (1, 2, 3, 4)], axis=0)
    return {"X": -settings["coefficient"] * speeds * record["state/u"]}


EFFECTS = [
    Effect(
        id="supply_voltage",
        stage="command",
        meaning="The same command makes less thrust from an emptier or a loaded battery.",
        parameters={
            "share": Parameter(0.0, "1", "of the change of voltage in the change of speed", 0.5),
            "nominal": Parameter(3.55, "V", "voltage at which the simulation is right", 0.0),
        },
        needs=("power/voltage",),
        replay=_sag,
    ),
    Effect(
        id="measured_speed",
        stage="command",
        meaning="Motors do not turn as they are told; their measured speed makes the thrust.",
        parameters={
            "share": Parameter(0.0, "1", "of measured speed in the thrust", 0.5, 0.0, 1.5),
            "thrust_constant": Parameter(3.7e-8, "1", "N over (rad/s)^2", 2e-9, 1e-8, 1e-7),
        },
        needs=("effector/n1", "effector/n2", "effector/n3", "effector/n4"),
        replay=_measured,
    ),
    Effect(
        id="rotor_drag",
        stage="airframe",
        meaning="Rotors in a cross flow hold the vehicle back.",
        parameters={"coefficient": Parameter(0.0, "1", "N over rad/s and m/s", 2e-6)},
        needs=("effector/n1", "state/u"),
        replay=_drag,
    ),
]
