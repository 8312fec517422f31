"""A global model predicts a flight in the user's own loop: ``freqid predict``, the flight, ``freqid score``.

The flight is integrated by other formulas than the prediction: the tilt-wing's loads as they are written
down, Euler's equations, the loop file's gains, servo and lag as differential equations.
"""

from __future__ import annotations

import json

import margins_case
import numpy as np
import pytest
import tilt_wing

import freqid as fq
from freqid.core.record import Channel, FlightRecord, write_record
from freqid.core.results.design import read_inputs

AT = tilt_wing.trim(9.0, 1.1, tilt_wing.trim(9.0, 1.225)["dw1"])
GRAVITY, MASS, INERTIA = 9.80665, 28.6, np.array([3.1, 6.6, 9.2])
SIGMA = {**dict.fromkeys("uvw", 0.05), **dict.fromkeys("pqr", 0.003), "phi": 0.003, "theta": 0.003}
SIGMA |= dict.fromkeys(("df", "dr", "da"), 0.001)
SERVO, DAMPING, LAG = 2 * np.pi * 6.0, 0.7, 0.03
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")


def scenario_text():
    lines = ['[vehicle]\nname = "tilt-wing"\nmass_kg = 28.6\ninertia = { xx = 3.1, yy = 6.6, zz = 9.2 }']
    lines += [
        f'[[effector]]\nname = "{e.name}"\nkind = "{e.kind}"\nlimits = {list(e.limits)}'
        for e in tilt_wing.VEHICLE.effectors
    ]
    lines += [
        f'[[wing]]\nname = "{w.name}"\ntilt = "{w.tilt}"\npivot_m = {list(w.pivot_m)}'
        for w in tilt_wing.VEHICLE.wings
    ]
    tilts = f"dw1 = {AT['dw1']}\ndw2 = {AT['dw2']}"
    lines.append(f'[[reference]]\nid = "u9"\nu = 9.0\nrho = 1.1\n{tilts}')
    lines.append("[excitation]\nband_hz = [0.1, 1.5]\nperiod_s = 15.0\nperiods = 2\nstarts = 1")
    lines.append("[excitation.amplitude]\ndf = 0.04\ndr = 0.02\nda = 0.02")
    lines.append("[identification]\n[identification.regressors]")
    lines += [f'{r} = ["u", "w", "q", "df", "dr"]' for r in "XZM"]
    lines += [f'{r} = ["v", "p", "r", "da"]' for r in "YLN"]
    lines.append("[noise]\n" + "\n".join(f"{n} = {x}" for n, x in SIGMA.items()))
    return "\n".join(lines)


def fly(inputs, seed):
    """Integrate the closed loop from the trim, and log it with noise."""
    trim = np.array([AT[n] for n in STATES[:6]] + [0.0, np.arctan2(AT["w"], 9.0)])
    names, time = ("df", "dr", "da"), np.arange(0.0, inputs.time[-1], 0.02)
    injected = {n: inputs.values[inputs.names.index(n)] for n in names}

    def rates(t, y):
        u, v, w, p, q, r, phi, theta = x = y[:8]
        e = {n: np.interp(t, inputs.time, row) for n, row in injected.items()}
        off = x - trim
        asked = {
            "dr": e["dr"] + 0.4 * off[4] + 1.0 * off[7] + 0.3 * y[8],
            "da": e["da"] - 0.2 * off[3] - 0.6 * off[6],
            "df": e["df"],
        }
        at = {**AT, **dict(zip(STATES[:6], x[:6], strict=True)), "df": e["df"], "dr": y[9], "da": y[12]}
        X, Y, Z, L, M, N = tilt_wing.loads(at)
        motion = [
            X / MASS - q * w + r * v - GRAVITY * np.sin(theta),
            Y / MASS - r * u + p * w + GRAVITY * np.cos(theta) * np.sin(phi),
            Z / MASS - p * v + q * u + GRAVITY * np.cos(theta) * np.cos(phi),
            (L - (INERTIA[2] - INERTIA[1]) * q * r) / INERTIA[0],
            (M - (INERTIA[0] - INERTIA[2]) * p * r) / INERTIA[1],
            (N - (INERTIA[1] - INERTIA[0]) * p * q) / INERTIA[2],
            p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)),
            q * np.cos(phi) - r * np.sin(phi),
            off[7],
        ]
        for name, (position, servo, speed) in {"dr": y[9:12], "da": y[12:15]}.items():
            acceleration = SERVO**2 * (asked[name] - servo) - 2 * DAMPING * SERVO * speed
            motion += [(servo - position) / LAG, speed, acceleration]
        return motion

    # df is not moved by the law: it follows at once
    y = np.empty((15, time.size))
    y[:, 0] = np.concatenate([trim, np.zeros(7)])
    for k, t in enumerate(time[:-1]):  # Runge and Kutta's fourth order
        a = np.array(rates(t, y[:, k]))
        b = np.array(rates(t + 0.01, y[:, k] + 0.01 * a))
        c = np.array(rates(t + 0.01, y[:, k] + 0.01 * b))
        d = np.array(rates(t + 0.02, y[:, k] + 0.02 * c))
        y[:, k + 1] = y[:, k] + 0.02 / 6 * (a + 2 * b + 2 * c + d)
    e = {n: np.interp(time, inputs.time, row) for n, row in injected.items()}
    values = {f"state/{n}": row for n, row in zip(STATES, y, strict=False)}
    values |= {"effector/df": e["df"], "effector/dr": y[9], "effector/da": y[12]}
    at = {**AT, **{n: values[f"state/{n}"] for n in STATES[:6]}}
    force = tilt_wing.loads(at | {n: values[f"effector/{n}"] for n in names})[:3] / MASS
    values |= {f"state/{n}": row for n, row in zip(("ax", "ay", "az"), force, strict=True)}
    rng, channels = np.random.default_rng(seed), {}
    units = {**tilt_wing.UNITS, "phi": "rad", "theta": "rad", "ax": "m/s2", "ay": "m/s2", "az": "m/s2"}
    for name, row in values.items():
        short = name.partition("/")[2]
        noisy = row + SIGMA.get(short, 0.0) * rng.standard_normal(row.size)
        channels[name] = Channel(name, units[short], noisy, 50.0, "flown")
    for name in ("n1", "n2", "dw1", "dw2"):
        unit = "rad/s" if name[0] == "n" else "rad"
        still = np.full(time.size, float(AT[name]))
        channels[f"effector/{name}"] = Channel(f"effector/{name}", unit, still, 50.0, "flown")
    for name, row in e.items():
        channels[f"excitation/{name}"] = Channel(f"excitation/{name}", "rad", row, 50.0, "flown")
    channels["air/rho"] = Channel("air/rho", "kg/m3", np.full(time.size, 1.1), 50.0, "flown")
    provenance = {"flown_utc": "2099-01-01T00:00:00+00:00"}
    return FlightRecord(time, channels, tilt_wing.VEHICLE, reference="u9", provenance=provenance)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    (folder / "s.toml").write_text(scenario_text())
    (folder / "loop.toml").write_text(margins_case.LOOP)
    fq.save(margins_case.aircraft(), folder / "aircraft.h5")
    for seed, name in ((1, "first"), (2, "second")):
        fq.save(fq.design_inputs(folder / "s.toml", seed=seed), folder / f"{name}.h5")
        write_record(folder / f"{name}-flight.h5", fly(read_inputs(folder / f"{name}.h5"), seed))
    return folder


def predict(freqid, folder, *options):
    words = ("predict", folder / "aircraft.h5", folder / "second.h5", "--scenario", folder / "s.toml")
    return freqid(*words, "--at", "u9", "--draws", 20, "--no-page", *options)


def test_a_flight_in_the_users_loop_is_as_the_global_model_predicts(freqid, folder, tmp_path):
    sealed, point = tmp_path / "p.h5", tmp_path / "point.h5"
    words = ("identify-point", folder / "first-flight.h5", "--scenario", folder / "s.toml", "-o", point)
    assert freqid(*words)[0] == 0
    law = ("--loop", folder / "loop.toml", "--residual", point)
    code, out, err = predict(freqid, folder, *law, "-o", sealed, "--json")
    assert code == 0, err
    said = json.loads(out)
    assert said["model"]["kind"] == "global"
    assert said["settings"]["law"] == "attitude hold with its own actuators"
    assert said["settings"]["loop"]["file"].endswith("loop.toml")
    assert len(said["settings"]["loop"]["sha256"]) == 64
    code, out, err = freqid("score", sealed, folder / "second-flight.h5", "--json", "--no-page")
    assert code == 0, err
    score = json.loads(out)
    assert score["passed"]
    # attitude, rates and the effectors that the loop moves are predicted, not only covered
    for name in ("p", "q", "phi", "theta", "dr", "da"):
        channel = score["channels"][f"free-run/{name}"]
        assert channel["theil"] < 0.15, name
        assert 0.7 < channel["rmse"] / channel["expected_rmse"] < 1.4, name


def test_without_the_loop_the_spiral_is_refused(freqid, folder, tmp_path):
    code, _, err = predict(freqid, folder, "-o", tmp_path / "p.h5")
    assert code == 2
    assert "the free-running response is unstable: a motion in" in err
    assert "--loop" in err


def test_another_loop_is_another_prediction(freqid, folder, tmp_path):
    """The flight tells the loop that it was flown in from one with half the gains in pitch."""
    soft = margins_case.LOOP.replace("q = 0.4", "q = 0.2").replace("theta = 1.0", "theta = 0.5")
    (tmp_path / "soft.toml").write_text(soft)
    code, _, err = predict(freqid, folder, "--loop", tmp_path / "soft.toml", "-o", tmp_path / "p.h5")
    assert code == 0, err
    code, out, _ = freqid("score", tmp_path / "p.h5", folder / "second-flight.h5", "--json", "--no-page")
    channels = json.loads(out)["channels"]
    for name in ("q", "theta", "dr"):
        channel = channels[f"free-run/{name}"]
        assert channel["rmse"] > 2 * channel["expected_rmse"], name
    assert channels["free-run/p"]["rmse"] < 1.4 * channels["free-run/p"]["expected_rmse"]


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--loop", "none.toml"], 3, "none.toml: cannot be read"),
        (["--loop", "loop.toml", "--no-feedback"], 2, "a loop is given that is not to be closed"),
        (["--loop", "aircraft.h5"], 2, "is no loop file"),
        (["--loop", "canard.toml"], 2, "the aircraft has no effector 'dc'"),
        (["--loop", "scheduled.toml"], 2, "scheduled from 20 to 30 m/s, the condition is at 9 m/s"),
    ],
)
def test_a_loop_that_does_not_fit_is_one_sentence(freqid, folder, tmp_path, options, code, words):
    (folder / "canard.toml").write_text(
        margins_case.LOOP.replace("da = ", "dc = ").replace("gains.da", "gains.dc")
    )
    (folder / "scheduled.toml").write_text(
        'signals = { q = "deg/s" }\ncommands = { dr = "deg" }\n'
        + "".join(f"[[condition]]\nu = {u}.0\ngains = {{ dr = {{ q = 0.4 }} }}\n" for u in (20, 30))
    )
    paths = [folder / o if "." in o else o for o in options]
    found, out, err = predict(freqid, folder, *paths, "-o", tmp_path / "p.h5")
    assert (found, out) == (code, ""), err
    assert words in err
    assert err.count("\n") == 1
    assert not (tmp_path / "p.h5").exists()
