"""A pitch gyro that feels acceleration, as cheap ones do."""

from dataclasses import replace

from freqid.simulate.effects.effect import Effect, Parameter


def distort(settings, record):
    """Return the record as the gyro would have made it."""
    gyro = record.channel("state/q")
    read = gyro.values + settings["per_g"] * record["state/az"] / 9.80665
    return record.with_channels(replace(gyro, values=read))


EFFECT = Effect(
    id="gyro_acceleration",
    stage="sensor",
    meaning="The pitch gyro feels the normal acceleration.",
    parameters={"per_g": Parameter(0.0, "rad/s", "rate that is read for 1 g", scale=0.005)},
    needs=("state/q", "state/az"),
    distort=distort,
)
