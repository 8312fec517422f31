"""What a prediction takes for granted, each with the figure beyond which a flight contradicts it."""

from __future__ import annotations

import numpy as np

from freqid.blend.sealed.bands import FreeRun
from freqid.blend.sealed.condition import ModelAtCondition
from freqid.core.results.prediction import Assumption
from freqid.core.vehicle import Vehicle

AS_DESIGNED = 0.1
"""That an injection may differ from the design in size."""
FARTHER = 1.0
"""Times the motion of the identification: a trim that is farther off is outside what the model knows."""
LARGER = 1.5
"""Times the motion of the identification: what a linear model was not tried at beyond this."""
DENSITY = 0.05
"""Relative change of air density: loads at the same speed change as much."""
LIMITED = 0.02
"""Share of the time that an effector may be at a limit, as in a quick look."""
NOISIER = 1.25
"""Times the stated noise of a sensor."""
FALSE_ALARM = 0.001
"""Probability that a flight as predicted is said to have more disturbances, or another structure."""


def assumptions(
    model: ModelAtCondition, vehicle: Vehicle, stated_noise: bool, gust: str, law: str
) -> tuple[Assumption, ...]:
    """Return what a prediction assumes.

    Parameters
    ----------
    model : ModelAtCondition
    vehicle : Vehicle
    stated_noise : bool
        Whether the noise of any sensor is stated.
    gust : str
        The gusts that the bands hold, in words.
    law : str
        Where the control law comes from.
    """
    at = model.reference
    place = f"'{at.id}'" if at.id else f"u = {at.u:.4g} m/s"
    nothing = float("nan")
    return (
        Assumption(
            "excitation",
            "The design is injected whole, as it is, at the commands of its effectors",
            AS_DESIGNED,
            "relative size of an injection",
        ),
        Assumption(
            "trim",
            f"The aircraft is trimmed at {place}, where the model was made",
            FARTHER,
            "rms of the identification",
        ),
        Assumption(
            "density",
            f"The air has {at.rho:.4g} kg/m3",
            DENSITY,
            "relative change of density",
        ),
        Assumption(
            "amplitude",
            "The aircraft moves no farther than when the model was identified, where linear loads were tried",
            LARGER,
            "rms of the identification",
        ),
        Assumption(
            "limits",
            "No effector reaches a limit of position or rate",
            LIMITED,
            "share of the time",
        ),
        Assumption(
            "noise",
            "Sensors have the stated noise" if stated_noise else "Sensors have no noise: none is stated",
            NOISIER if stated_noise else nothing,
            "stated noise",
        ),
        Assumption(
            "disturbances",
            f"Nothing moves the aircraft but the design, {gust} and loads like those that the fit left",
            FALSE_ALARM,
            "probability of a false alarm",
        ),
        Assumption(
            "structure",
            "The loads depend on the model's regressors as linearly as where it was identified",
            FALSE_ALARM,
            "probability of a false alarm",
        ),
        Assumption("law", f"The control law is that of {law}, and its sensors err by nothing", nothing, ""),
        Assumption("mass", f"The aircraft has {vehicle.mass_properties.mass_kg:.4g} kg", nothing, ""),
    )


def warnings(model: ModelAtCondition, run: FreeRun, vehicle: Vehicle) -> tuple[str, ...]:
    """Return what is doubtful already before the flight: amplitudes, limits, unstable models, no residual.

    Parameters
    ----------
    model : ModelAtCondition
    run : FreeRun
    vehicle : Vehicle
    """
    said = []
    identified = motion_of_the_identification(model)
    for channel in run.channels:
        ratio = float(channel.change.std()) / identified.get(channel.name, np.inf)
        if ratio > LARGER:
            said.append(
                f"{channel.name} is predicted to move {ratio:.1f} times as much as when the model was made"
            )
        if channel.kind == "effector" and np.isfinite(channel.trim):
            low, high = vehicle.effector(channel.name).limits
            reach = channel.trim + np.array([channel.lower.min(), channel.upper.max()])
            if reach[0] < low or reach[1] > high:
                said.append(
                    f"{channel.name} is predicted to reach {reach[0]:.4g} to {reach[1]:.4g} {channel.unit}, "
                    f"beyond its limits {low:.4g} to {high:.4g}"
                )
    if run.unstable_draws > 0:
        said.append(
            f"the loop is unstable for {100 * run.unstable_draws:.0f} % of the models that the covariance "
            "allows"
        )
    if not model.responses[0].residual_hz.size:
        said.append(
            "the model keeps no residual on lines, so that the bands hold nothing of what its fit left"
        )
    quiet = [c.name for c in run.channels if c.kind != "wrench" and c.noise_std == 0]
    if quiet:
        said.append(f"no noise is stated of {' '.join(quiet)}, so that their bands hold none")
    return tuple(said)


def motion_of_the_identification(model: ModelAtCondition) -> dict[str, float]:
    """Return by how much each regressor moved when the model was identified, rms, SI."""
    return {n: float(x) for r in model.responses for n, x in zip(r.regressors, r.regressor_rms, strict=True)}
