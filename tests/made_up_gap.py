"""A made-up diagnosis of a gap, for tests of what is done with one."""

import math

import numpy as np

from freqid.core.results.diagnosis import (
    Change,
    Closure,
    Existence,
    GapDiagnosis,
    Interval,
    Place,
    SensorFault,
    Share,
    ToleranceUsed,
    Which,
)
from freqid.core.results.gap import BeforeAfter, GapMap, GapResult, Increment, ResidualSpectra


def made_up(exists=True):
    """Return a diagnosis with something of everything."""
    rng, nan = np.random.default_rng(0), math.nan
    figure = {"before": 45.0, "after": 42.0, "change": -3.0, "lo": nan, "hi": nan}
    which = Which(
        {"stall": 0.7, "other": 0.2, "none": 0.1},
        ("stall", "other"),
        (("mass", "sensor_scale"),),
        {"gyroscopic": "needs rotor, which is not there"},
        {"stall": {"strength": Interval(0.4, 0.3, 0.5, "1")}},
        withdrawn={"mass": "the size of mass is at the end of what is physical"},
        places={"stall": "onset=0.2"},
        groups={"tail": ("de", "dr")},
    )
    closure = Closure(
        ("stall",),
        {"stall": {"strength": Interval(0.45, 0.4, 0.5, "1")}},
        Share(0.8, 0.7, 0.9),
        Share(nan, nan, nan, "the simulation does not fly by itself"),
        {"Z": Change(4.0, 1.0, 8.0), "M": Change(2.0, 2.0, 4.0)},
        {"Z": Change(0.2, 0.1, 1.0), "M": Change(0.4, 0.3, 1.0)},
        {"Z": Change(120.0, 40.0), "M": Change(80.0, 20.0)},
        ("c.h5",),
        "a note",
        {"sentence": "as flown it costs 3.0 deg", "figures": {"margins/M/phase_deg": figure}},
        effect_only=Share(0.75, 0.65, 0.85),
        tolerances_only=Share(0.3, 0.2, 0.4),
        log_score=12.5,
        strained={"derivatives.Z.w": -4.2},
    )
    diagnosis = GapDiagnosis(
        "A gap beyond noise.",
        "sim.py:wrench",
        ("a.h5", "b.h5", "c.h5"),
        Existence(
            exists,
            1e-3,
            0.02,
            0.0,
            {"stall": 0.2, "mass": 0.1},
            {"stall": "1", "mass": "1"},
            {} if exists else {"stall": 0.2, "mass": 0.1},
            {"Z": 0.02},
            ("lines that nothing drives",),
        ),
        (Place("Z", (0.1, 0.5), "u10 u20", "de", "all", 0.6),),
        which,
        (closure,),
        remarks=("a remark",),
        sensors=(SensorFault("sensor_bias", "q", 0.01, 0.008, 0.012, "rad/s"),),
        tolerances=(
            ToleranceUsed("mass", 0.01, "1", "default"),
            ToleranceUsed("lift_slope", 0.3, "1/rad", "simulation"),
        ),
    )
    hz, z = np.linspace(0, 1.9, 20), rng.standard_normal((2, 20)) + 1j * rng.standard_normal((2, 20))
    spectra = [
        ResidualSpectra(n, ("Z", "M"), ("N", "N m"), hz, ("de",), (np.arange(20.0) % 2) - 1, z, z / 2, abs(z))
        for n in ("a.h5", "b.h5")
    ]
    x = rng.standard_normal((2, 50))
    changes = BeforeAfter(
        "c.h5",
        True,
        ("Z", "M"),
        ("N", "N m"),
        np.arange(50) / 5,
        x,
        x / 2,
        x / 3,
        hz,
        z,
        z / 2,
        z / 3,
        abs(z),
    )
    energy = rng.uniform(size=(2, 3, 2, 2))
    return GapResult(
        diagnosis,
        GapMap(
            ("Z", "M"),
            ("u10", "u20"),
            ("de", ""),
            ((0.1, 0.2), (0.2, 1.0), (1.0, 2.0)),
            energy,
            np.full((2, 3), 1 / 3),
        ),
        tuple(spectra),
        {"Z": {"de": 0.9}, "M": {"de": 0.1}},
        (Increment("M", "de", -25.0, -28.0, -22.0), Increment("Z", "w", 1.0, -3.0, 5.0)),
        (changes,),
        {"stall": 0.5, "mass": 0.05},
        {"records": ["a.h5", "b.h5"], "held out": ["c.h5"], "seed": 0},
    )
