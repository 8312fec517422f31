"""A tandem tilt-wing written down in a page: blown wings, propellers, a tail; and its point models.

Its loads are rho times a function of second degree in velocities, rates and rotor speeds, stall and
slipstream included, so density acts by similarity alone. Nothing here knows how models are blended.
"""

import numpy as np
from scipy.optimize import fsolve

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle, Wing
from freqid.identify.point import identify_point

WEIGHT = 28.6 * 9.80665
RESPONSES = ("X", "Y", "Z", "L", "M", "N")
LONGITUDINAL = ("u", "w", "q", "df", "dr", "n1", "n2")
LATERAL = ("v", "p", "r", "da")
INPUTS = (*LONGITUDINAL, *LATERAL)
UNITS = dict.fromkeys("uvw", "m/s") | dict.fromkeys(("p", "q", "r", "n1", "n2"), "rad/s")
UNITS |= dict.fromkeys(("df", "dr", "da"), "rad")
# What each input is moved by in a manoeuvre, rms, in its unit; rotors by a share of their speed.
MOVED = dict.fromkeys("uvw", 0.5) | dict.fromkeys("pqr", 0.1) | dict.fromkeys(("df", "dr", "da"), 0.06)
MOVED |= dict.fromkeys(("n1", "n2"), 0.03)
VEHICLE = Vehicle(
    name="tilt-wing",
    mass_properties=MassProperties(mass_kg=28.6, inertia=Inertia(xx=3.1, yy=6.6, zz=9.2)),
    effectors=(
        *(Effector(name=n, kind="surface", limits=(-1, 1)) for n in ("df", "dr", "da")),
        *(Effector(name=n, kind="rotor", limits=(0, 2000)) for n in ("n1", "n2")),
        *(Effector(name=n, kind="tilt", limits=(-0.2, 1.9)) for n in ("dw1", "dw2")),
    ),
    wings=(
        Wing(name="front", tilt="dw1", pivot_m=(0.6, 0, 0)),
        Wing(name="rear", tilt="dw2", pivot_m=(-0.6, 0, 0)),
    ),
)
SETTINGS = Identification(
    regressors={r: LONGITUDINAL if r in "XZM" else LATERAL for r in RESPONSES},
    responses=RESPONSES,
    response_source="record",
    frequencies_hz=tuple(np.arange(3, 109) / 60),
)


def loads(at):
    """Return X Y Z L M N, shape (6, n), of a mapping of inputs, ``dw1 dw2 rho`` among them."""
    rho, u, v, w = (np.asarray(at[n], float) for n in ("rho", "u", "v", "w"))
    p, q, r = at["p"], at["q"], at["r"]
    X = Z = M = L = 0.0
    disc, d = 4 * 0.25 * np.pi * 0.4064**2, 0.4064
    for arm, tilt, n, flap in ((0.6, at["dw1"], at["n1"], at["df"]), (-0.6, at["dw2"], at["n2"], 0.0)):
        z = w - q * arm
        along, across = u * np.cos(tilt) - z * np.sin(tilt), u * np.sin(tilt) + z * np.cos(tilt)
        turns = n / (2 * np.pi)
        thrust = 4 * rho * (0.1 * turns**2 * d**4 - 0.06 * turns * along * d**3 - 0.08 * along**2 * d**2)
        blown = np.sqrt(along**2 + 2 * thrust / (rho * disc))
        alpha = np.arctan2(across, blown)
        pressure = 0.5 * rho * (blown**2 + across**2) * 0.6
        lift = pressure * (1.2 + 1.8 * np.cos(2 * alpha)) * np.sin(alpha + 0.08 + 0.5 * flap)
        drag = pressure * (0.04 + 1.4 * np.sin(alpha) ** 2)
        chordwise = thrust - drag * np.cos(alpha) + lift * np.sin(alpha)
        normal = lift * np.cos(alpha) + drag * np.sin(alpha)  # up, off the wing's upper side
        X = X + chordwise * np.cos(tilt) - normal * np.sin(tilt)
        Z = Z - chordwise * np.sin(tilt) - normal * np.cos(tilt)
        M = M + arm * (chordwise * np.sin(tilt) + normal * np.cos(tilt))
        L = L + 0.05 * rho * blown * (blown * at["da"] * np.cos(tilt) * 2 - p * 0.9 + 0.1 * v)
    V = np.sqrt(u**2 + w**2 + v**2)
    tail = 0.5 * rho * V * 0.25
    X = X - 0.5 * rho * V * u * 0.05
    Y = -tail * 2.5 * (v - 0.8 * r)
    M = M - tail * 0.8 * (3.0 * (w + 0.8 * q) + 2.0 * V * at["dr"])
    N = tail * 0.8 * (2.2 * (v - 0.8 * r)) - 0.3 * rho * V * r
    return np.array(np.broadcast_arrays(X, Y, Z, L, M, N))


def trim(u, rho, tilt=None):
    """Trim level flight: with a level body, which gives the tilts, or at tilts, which gives the pitch."""

    def at(x):
        theta, tilts = (0.0, x[0]) if tilt is None else (x[0], tilt)
        zero = dict.fromkeys(("v", "p", "q", "r", "df", "dr", "da"), 0.0)
        wings = {"dw1": tilts, "dw2": tilts, "n1": 100 * x[1], "n2": 100 * x[2]}
        return theta, {"u": u, "w": u * np.tan(theta), "rho": rho} | wings | zero

    def unbalanced(x):
        theta, inputs = at(x)
        X, _, Z, _, M, _ = loads({k: np.array([v]) for k, v in inputs.items()})[:, 0]
        return [X - WEIGHT * np.sin(theta), Z + WEIGHT * np.cos(theta), M]

    guess = [1.45 * np.exp(-u / 9) + 0.03 if tilt is None else 0.0, 6.0 + 0.0 * u, 6.0]
    x, info, found, _ = fsolve(unbalanced, guess, full_output=True, xtol=1e-12)
    assert found == 1, (u, rho, tilt, x, info["fvec"])
    return at(x)[1]


def motion(at, seed, amplitude=1.0, duration=60.0, rate=25.0):
    """Return inputs over a manoeuvre: every input a multisine of its own lines about the trim."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate) + 1) / rate
    inputs = {name: np.full_like(time, at[name]) for name in ("dw1", "dw2", "rho")}
    for i, name in enumerate(INPUTS):
        lines = np.arange(3 + i, 109, len(INPUTS))
        phase = rng.uniform(0, 2 * np.pi, lines.size)
        signal = np.sin(2 * np.pi * lines[:, None] * time / duration + phase[:, None]).sum(axis=0)
        rms = MOVED[name] * (at[name] if name in ("n1", "n2") else 1.0)
        inputs[name] = at[name] + amplitude * rms * signal / np.sqrt(lines.size / 2)
    return time, inputs


NOISE = np.array([2.8, 2.8, 2.8, 0.5, 1.0, 1.0])  # N and N m: 0.01 g, and rates' noise at 1 Hz


def fly(at, seed, noise=1.0, **options):
    """Return a manoeuvre about a trim; its record holds the responses themselves, with noise."""
    time, inputs = motion(at, seed, **options)
    rng = np.random.default_rng([seed, 1])
    responses = loads(inputs)
    responses = responses + noise * NOISE[:, None] * rng.standard_normal(responses.shape)
    channels = {}
    for name, values in inputs.items():
        group = "air" if name == "rho" else "state" if name in "uvwpqr" else "effector"
        unit = {"rho": "kg/m3", "dw1": "rad", "dw2": "rad"}.get(name) or UNITS[name]
        channels[f"{group}/{name}"] = Channel(f"{group}/{name}", unit, values, 25.0, "written down")
    for name, values in zip(RESPONSES, responses, strict=True):
        unit = "N" if name in "XYZ" else "N m"
        channels[f"response/{name}"] = Channel(f"response/{name}", unit, values, 25.0, "written down")
    return Maneuver(FlightRecord(time, channels, VEHICLE), VEHICLE)


def reference(at, name):
    return Reference.of(id=name, **{n: float(at[n]) for n in ("u", "rho", "dw1", "dw2")})


def point(at, name, seed, noise=1.0, **options):
    """Identify a point model of a manoeuvre about a trim."""
    return identify_point(fly(at, seed, noise, **options), SETTINGS, reference=reference(at, name))


def derivatives(at):
    """Return the exact bias, shape (6,), and derivatives, shape (6, input), at a trim, by differences."""
    x0 = np.array([at[n] for n in INPUTS])
    step = np.diag(np.where([n in ("n1", "n2") for n in INPUTS], 0.05, 1e-4))
    x = np.concatenate([x0[:, None], x0[:, None] + step, x0[:, None] - step], axis=1)
    y = loads(
        dict(zip(INPUTS, x, strict=True)) | {n: np.full(x.shape[1], at[n]) for n in ("dw1", "dw2", "rho")}
    )
    n = len(INPUTS)
    return y[:, 0], (y[:, 1 : 1 + n] - y[:, 1 + n :]) / (2 * np.diag(step))


def exact_point(at, name, seed=None, correlation=0.4):
    """Return the point model of the exact derivatives, drawn about them with its covariance where seeded."""
    bias, slope = derivatives(at)
    rng, responses = np.random.default_rng(seed), {}
    for i, r in enumerate(RESPONSES):
        regressors = SETTINGS.regressors_of(r)
        p = len(regressors)
        size = np.array([MOVED[n] * (500.0 if n[0] == "n" else 1.0) for n in regressors])
        std = 0.02 * NOISE[i] / size
        covariance = np.outer(std, std) * (correlation + (1 - correlation) * np.eye(p))
        estimate, b = slope[i, [INPUTS.index(n) for n in regressors]], bias[i]
        if seed is not None:
            estimate, b = (
                rng.multivariate_normal(estimate, covariance),
                b + 0.02 * NOISE[i] * rng.standard_normal(),
            )
        responses[r] = ResponseModel(
            response=r,
            unit="N" if r in "XYZ" else "N m",
            regressors=regressors,
            regressor_units=tuple(UNITS[n] for n in regressors),
            trim=np.array([at[n] for n in regressors]),
            regressor_rms=size,
            estimate=estimate,
            std_error=std,
            covariance=covariance,
            lower=estimate - 2 * std,
            upper=estimate + 2 * std,
            bias=float(b),
            bias_std_error=0.02 * NOISE[i],
            r2=1.0,
            pse=0.0,
            rmse=0.0,
            fit_error=0.0,
            t_statistic=estimate / std,
            variance_inflation=np.ones(p),
            correlation=covariance / np.outer(std, std),
            condition_index=np.ones(p),
            variance_proportion=np.full((p, p), 1 / p),
            inseparable=(),
            fit={"time": Fit(np.zeros(2), np.zeros(2), np.zeros(2))},
        )
    return PointModel(reference(at, name), responses, "frequency", "force", "body", 0.95, 60.0, VEHICLE.name)
