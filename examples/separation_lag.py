"""An effect of one's own for ``--effects``: flow over a wing at high angles of attack separates late.

What separation takes from the normal force follows the angle of attack with a first-order lag, so that quick
changes meet the slope of the attached flow and slow ones the static slope (an indicial function with one lag:
Klein, V., and Morelli, E. A., *Aircraft System Identification*, AIAA, 2006). The library's ``unsteady_lift``
is another thing: there all of the lift comes late, and quick changes meet less of it.
"""

from freqid.simulate.effects.effect import Effect, Parameter


def replay(settings, replay):
    """Return what the effect adds to the coefficient of the force along z."""
    record = replay.record
    alpha, q = record["air/alpha"], record["state/q"]
    late = alpha - replay.lagged(alpha, settings["time_constant"])
    normal = settings["strength"] * late + settings["static"] * (alpha - alpha.mean()) + settings["rate"] * q
    return {"CZ": -normal}


EFFECT = Effect(
    id="separation_lag",
    stage="airframe",
    meaning="What separation takes from the normal force comes late.",
    parameters={
        "strength": Parameter(0.0, "1", "slope of the attached flow less the static one, per rad", 1.0),
        "time_constant": Parameter(5.0, "s", "of the lag", 3.0, 0.2, 60.0),
        "static": Parameter(0.0, "1", "change of the static slope, per rad", 1.0),
        "rate": Parameter(0.0, "s", "change of the part that goes with pitch rate", 0.5),
    },
    needs=("air/alpha", "state/q"),
    replay=replay,
)
