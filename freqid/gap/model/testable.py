"""Which effects can be tested on a simulation and a manoeuvre, and by which of their hooks."""

from __future__ import annotations

from freqid.core.vehicle import Vehicle
from freqid.gap.simulation import Simulation
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects.effect import Effect


def untestable(effect: Effect, trial: Trial) -> str | None:
    """Return why an effect cannot be tested here, or None where it can.

    A missing field is a reason not to test, never one to rule the effect out.
    """
    route = route_of(effect, trial.simulation)
    if route is None:
        return "the simulation does not have it, and it cannot be added to one that does not"
    record = trial.maneuver.record
    for need in effect.needs:
        if not _there(need, trial, route):
            return f"needs {need}, which is not there"
        # what a rotor or wing does cannot be computed without how fast it turns, or where it is
        for name in _described(need, trial.maneuver.vehicle) if "effector" in effect.needs else ():
            if f"effector/{name}" not in record:
                return f"needs effector/{name}, which is not there"
    if route == "act" and not (trial.positions or record.group("effector")):
        return "needs positions or commands of effectors, which are not there"
    return None


def _there(need: str, trial: Trial, route: str) -> bool:
    """Return whether what an effect needs is there; see `Effect.needs`."""
    if " or " in need:
        return any(_there(one, trial, route) for one in need.split(" or "))
    record, vehicle = trial.maneuver.record, trial.maneuver.vehicle
    head, _, rest = need.partition(".")
    if head == "simulation":
        return route != "own" or any(part.startswith(need) for part in trial.simulation.parts)
    if head == "vehicle":
        return getattr(vehicle, rest, None) is not None
    if need == "rotor":  # a kind of effector that needs no description
        return bool(vehicle.rotors) or need in vehicle.effector_kinds.values()
    if head in ("rotor", "wing"):
        return bool(_described(need, vehicle))
    if "/" in need:
        return need in record
    return need in vehicle.effector_kinds.values() or bool(record.group(need))


def _described(need: str, vehicle: Vehicle) -> list[str]:
    """Return the effectors of the rotors, or tilting wings, that meet a need such as ``rotor.diameter_m``."""
    head, _, rest = need.partition(".")
    if head == "wing":
        return [w.tilt for w in vehicle.wings]
    return [r.name for r in vehicle.rotors if getattr(r, rest)] if head == "rotor" and rest else []


def route_of(effect: Effect, simulation: Simulation) -> str | None:
    """Return the hook by which an effect is tested, or ``own`` where the simulation computes it."""
    for hook in ("distort", "load", "feel", "act"):
        if getattr(effect, hook) is not None:
            return hook
    own = effect.id in simulation.effects
    if effect.replay is not None and (effect.states or not own):
        return "replay"
    return "own" if own else None


def in_force_of(effect: Effect, simulation: Simulation) -> dict[str, float]:
    """Return the settings that a simulation has an effect at: zero size where it does not have it."""
    if route_of(effect, simulation) == "own":
        return {n: p.default for n, p in effect.parameters.items()} | dict(simulation.effects[effect.id])
    return {n: p.default for n, p in effect.parameters.items()} | {effect.size: 0.0}
