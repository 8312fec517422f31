"""Loop files, MAT files, Python files and python-control objects become the same law."""

from __future__ import annotations

import control
import margins_case
import numpy as np
import pytest
import tilt_wing
from scipy.io import savemat

from freqid.compare.read_law import law_of
from freqid.core.errors import DataError, UsageError
from freqid.dynamics.linear_loop import Actuation

VEHICLE = tilt_wing.VEHICLE
SIGNALS, COMMANDS = ["q", "theta", "p", "phi"], ["dr", "da"]
# One integrator, of theta; degrees cancel, so that these gains are SI.
A, B = [[0.0]], [[0.0, 1.0, 0.0, 0.0]]
C, D = [[0.3], [0.0]], [[0.4, 1.0, 0.0, 0.0], [0.0, 0.0, -0.2, -0.6]]


def at(given, u=9.0):
    return law_of(given, VEHICLE)[0](u, 1.1, {})


def write(tmp_path, text, name="loop.toml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def same(law, *, sign=1.0):
    assert law.signals == tuple(SIGNALS)
    assert law.effectors == law.axes == tuple(COMMANDS)
    s = 1j * np.array([0.3, 4.0])[:, None, None]
    for k in s:
        found = law.C @ np.linalg.solve(k * np.eye(len(law.A)) - law.A, law.B) + law.D
        expected = np.array(C) @ (1 / k * np.array(B)) + np.array(D)
        np.testing.assert_allclose(found, sign * expected, rtol=1e-12, atol=1e-12)


def test_all_forms_say_the_same(tmp_path):
    same(at(write(tmp_path, margins_case.LOOP)))
    held = {"A": A, "B": B, "C": C, "D": D, "signals": np.array(SIGNALS, object)}
    mat = tmp_path / "loop.mat"
    savemat(mat, held | {"commands": np.array(COMMANDS, object)})
    same(at(mat))
    savemat(
        mat,
        held
        | {"commands": np.array(COMMANDS, object), "sign": -1.0}
        | {"signal_units": np.array(["deg/s", "deg", "deg/s", "deg"], object)}
        | {"command_units": np.array(["deg", "deg"], object)},
    )
    same(at(mat), sign=-1.0)
    system = control.ss(A, B, C, D, inputs=SIGNALS, outputs=COMMANDS)
    same(at(system))
    same(at(lambda u, rho: system))
    text = f"import control\nhold = control.ss({A}, {B}, {C}, {D}, inputs={SIGNALS}, outputs={COMMANDS})\n"
    same(at(f"{write(tmp_path, text, 'mine.py')}:hold"))


def test_units_convert(tmp_path):
    text = '[signals]\nq = "deg/s"\nu = "kt"\n[commands]\ndr = "rad"\nn1 = "rpm"\n'
    text += "[gains.dr]\nq = 0.1\n[gains.n1]\nu = -50\n"
    law = at(write(tmp_path, text))
    assert law.D[0, 0] == pytest.approx(0.1 * 180 / np.pi)
    assert law.D[1, 1] == pytest.approx(-50 * 2 * np.pi / 60 / (1852 / 3600))


def test_axes_are_shared_among_effectors(tmp_path):
    text = '[signals]\nq = "rad/s"\n[axes]\npitch = "1"\n[commands]\ndr = "deg"\ndf = "deg"\n'
    text += "[gains.pitch]\nq = 2.0\n[allocation.dr]\npitch = 3.0\n[allocation.df]\npitch = -1.0\n"
    law = at(write(tmp_path, text))
    assert law.axes == ("pitch",)
    np.testing.assert_allclose(law.allocation[:, 0], np.radians([3.0, -1.0]))
    assert law.D[0, 0] == pytest.approx(2.0)


def test_a_schedule_is_straight_between_its_speeds(tmp_path):
    text = '[signals]\nq = "rad/s"\n[commands]\ndr = "rad"\n[actuator.dr]\ndelay_s = 0.02\n'
    text += "[[condition]]\nu = 5.0\ngains = { dr = { q = 1.0 } }\n"
    text += "[[condition]]\nu = 15.0\ngains = { dr = { q = 0.5 } }\n"
    path = write(tmp_path, text)
    law = at(path, 7.0)
    assert law.D[0, 0] == pytest.approx(0.9)
    assert law.actuation.frequency[0] == np.inf
    assert law.actuation.delay[0] == pytest.approx(0.02)
    with pytest.raises(UsageError, match="scheduled from 5 to 15 m/s, the condition is at 20 m/s"):
        at(path, 20.0)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (
            ("theta =", "tetha ="),
            UsageError,
            r"\[signals\]: no sensor measures 'tetha'; did you mean .*'theta'",
        ),
        (('p = "deg/s"', 'p = "ft/s"'), DataError, r"\[signals\] p: found unit 'ft/s', .* 'rad/s'"),
        (('dr = "deg"', 'dr = "lbf"'), DataError, r"\[commands\] dr: found unit 'lbf', .* 'rad'"),
        (('da = "deg"', 'ail = "deg"'), UsageError, r"\[commands\]: the aircraft has no effector 'ail'"),
        (("phi = -0.6", "psi = -0.6"), UsageError, r"\[gains.da\]: 'psi' is not among the file's names"),
        (("[gains.da]", "[gains.df]"), UsageError, r"\[gains.df\]: 'df' is not among the file's names"),
        (("[actuator.default]", "[actuator.da2]"), UsageError, r"\[actuator.da2\]: the law does not move it"),
        (("lag_s = 0.03", "lag_s = -1"), UsageError, "zero or more"),
        (("damping =", "dampng ="), UsageError, "key 'dampng' is unknown; did you mean 'damping'"),
    ],
)
def test_what_does_not_fit_is_said_in_a_sentence(tmp_path, change, error, words):
    path = write(tmp_path, margins_case.LOOP.replace(*change, 1))
    with pytest.raises(error, match=words) as found:
        at(path)
    assert "loop.toml" in str(found.value)


def test_other_things_are_refused(tmp_path):
    with pytest.raises(UsageError, match=r"the law is discrete, at steps of 0\.02 s"):
        at(control.ss(A, B, C, D, 0.02, inputs=SIGNALS, outputs=COMMANDS))
    with pytest.raises(UsageError, match="the law measures 'u\\[0\\]'"):
        at(control.ss(A, B, C, D))
    with pytest.raises(UsageError, match="found int, expected a control law"):
        at(3)
    with pytest.raises(DataError, match="no such file"):
        at(tmp_path / "no.mat")
    with pytest.raises(UsageError, match="is no loop file"):
        at(tmp_path / "loop.csv")
    mat = tmp_path / "loop.mat"
    savemat(mat, {"D": {"a": 1.0}, "signals": ["q"], "commands": ["dr"]})
    with pytest.raises(DataError, match=r"variable 'D' is no matrix of numbers; save A, B, C and D as"):
        at(mat)
    savemat(mat, {"D": D})
    with pytest.raises(DataError, match="has no variable 'signals'"):
        at(mat)
    text = '[signals]\nq = "rad/s"\n[commands]\ndr = "rad"\n[state_space]\nA = [[-1.0]]\n'
    text += "B = [[1.0, 2.0]]\nC = [[1.0]]\n"
    with pytest.raises(UsageError, match="B has shape \\(1, 2\\), expected \\(1, 1\\)"):
        at(write(tmp_path, text))


def test_actuators_have_their_own_dynamics(tmp_path):
    text = margins_case.LOOP + "[actuator.da]\ndelay_s = 0.05\ngain = 0.9\n"
    act = at(write(tmp_path, text)).actuation
    assert isinstance(act, Actuation)
    w = np.array([2.0, 20.0])
    s = 1j * w
    servo = 1 / ((s / (12 * np.pi)) ** 2 + 1.4 * s / (12 * np.pi) + 1) / (0.03 * s + 1)
    np.testing.assert_allclose(act.response(w), [servo, 0.9 * np.exp(-0.05 * s)], rtol=1e-12)
