"""What several effects at once make of a residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from freqid.gap.histories import Histories
from freqid.gap.signature import made
from freqid.gap.testable import in_force_of, route_of
from freqid.gap.trial import Trial
from freqid.simulate.effects.effect import Effect


def together(
    effects: Sequence[Effect],
    trial: Trial,
    settings: Mapping[str, Mapping[str, float]],
    *,
    in_full: bool = True,
) -> Histories:
    """Return the change that effects make of a residual, other parameters at their values in force.

    Parameters
    ----------
    effects : sequence of Effect
    trial : Trial
    settings : dict of dict of float
        By effect id.
    in_full : bool
        Whether what sensors distort is undone in full, not by derivatives, and what acts in an actuator's
        loop is asked of a simulation that has it.

    Notes
    -----
    Those between command and airframe follow one another in the order given: a delay and a lag together are
    not the sum of what each does alone. All others add up.
    """
    total, chain, inside = trial.rows(), [], {}
    for effect in effects:
        values = {**in_force_of(effect, trial.simulation), **settings.get(effect.id, {})}
        route = route_of(effect, trial.simulation)
        hook = effect.act if route == "act" else effect.feel if route == "feel" else None
        if hook is None or (trial.positions and route == "feel"):
            total = total + made(effect, trial, settings.get(effect.id, {}), in_full=in_full)
        elif values != in_force_of(effect, trial.simulation):
            if in_full and effect.in_loop and trial.positions and effect.id in trial.simulation.effects:
                inside[effect.id] = values
            else:
                chain.append((hook, values))
    if not chain and not inside:
        return total
    record, kinds = trial.maneuver.record, trial.maneuver.vehicle.effector_kinds
    before = trial.positions or {n: record[f"effector/{n}"] for n in record.group("effector")}
    after = trial.simulation.positions(record, inside) if inside else before
    for hook, values in chain:
        after = {**after, **hook(values, after, record.dt, kinds)}
    changes = {n: after[n] - x for n, x in before.items()}
    if trial.positions:
        return total + trial.rows(positions=changes)
    return total + trial.rows(trial.moved({f"effector/{n}": x for n, x in changes.items()}))
