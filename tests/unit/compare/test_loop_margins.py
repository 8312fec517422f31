"""Margins of an identified model against python-control, its intervals against linear propagation."""

from __future__ import annotations

from dataclasses import replace

import control
import margins_case
import msgspec
import numpy as np
import pytest
import tilt_wing

import freqid as fq
from freqid.compare.loop_margins import loop_margins, places_of
from freqid.compare.read_law import law_of
from freqid.core.errors import DataError, UsageError
from freqid.core.scenario import Reference

DRAWS = 120


@pytest.fixture(scope="module")
def model():
    return margins_case.aircraft()


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    path = tmp_path_factory.mktemp("loop") / "loop.toml"
    path.write_text(margins_case.LOOP)
    return path


@pytest.fixture(scope="module")
def found(model, loop):
    return fq.margins(model, loop, "u9", draws=DRAWS)


def roll_loop(model):
    """Return the loop gain at the aileron by python-control alone, the pitch loop closed."""
    s, w = control.tf("s"), 12 * np.pi
    actuator = control.ss(1 / ((s / w) ** 2 + 1.4 * s / w + 1) / (0.03 * s + 1))
    aircraft = model.to_control(u=9.0, rho=1.1)
    plant = aircraft * control.append(*[actuator] * aircraft.ninputs)
    effectors, states = list(aircraft.input_labels), list(aircraft.output_labels)
    seen, driven = np.zeros((1, len(states))), np.zeros((len(effectors), 1))
    seen[0, states.index("theta")], driven[effectors.index("dr")] = 1.0, 0.3
    direct = np.zeros((len(effectors), len(states)))
    direct[effectors.index("dr"), [states.index("q"), states.index("theta")]] = 0.4, 1.0
    pitch = control.ss([[0.0]], seen, driven, direct)
    rolling = control.feedback(plant, pitch, sign=1)
    rows = np.zeros((1, len(states)))
    rows[0, [states.index("p"), states.index("phi")]] = 0.2, 0.6  # minus the file's: negative feedback
    column = [effectors.index("da")]
    return control.ss(rolling.A, rolling.B[:, column], rows @ rolling.C, rows @ rolling.D[:, column])


def test_margins_are_those_of_python_control(model, found):
    margins = {k.rpartition("/")[2]: v[0] for k, v in found["u9"].items() if k.startswith("margins/da/")}
    loop = control.frd(roll_loop(model), np.geomspace(0.01, 300, 4000))
    _, phase, _, _, crossover, _ = control.stability_margins(loop)
    assert margins["phase_deg"] == pytest.approx(phase, abs=0.01)
    assert 2 * np.pi * margins["crossover_hz"] == pytest.approx(crossover, rel=1e-4)
    every = control.stability_margins(loop, returnall=True)[0]
    assert margins["gain_up_db"] == pytest.approx(min(20 * np.log10(g) for g in every if g > 1), abs=0.005)
    disk = control.disk_margins(roll_loop(model), loop.omega, skew=0.0)[0]
    assert margins["disk"] == pytest.approx(float(disk), rel=1e-3)


def test_closed_loop_modes_are_eigenvalues_of_python_controls_loop(model, found):
    poles = (control.feedback(roll_loop(model), 1)).poles()
    named = {k for k in found["u9"] if k.startswith("closed_modes/") and k.endswith("frequency")}
    for path in named:
        frequency, damping = (
            found["u9"][path][0],
            found["u9"][path.replace("frequency", "damping")][0],
        )
        pole = frequency * (-damping + 1j * np.sqrt(max(1 - damping**2, 0)))
        assert np.abs(poles - pole).min() < 1e-5


def test_intervals_are_those_of_linear_propagation(model, loop, found):
    """One derivative of the wrench after the other moved by a little, with the covariance of the point."""
    law, _ = law_of(loop, tilt_wing.VEHICLE)
    path = "margins/da/phase_deg"
    corridor, k = model.corridor, model.corridor.ids.index("u9")

    def phase(changed):
        of = fq.GlobalModel(replace(corridor, responses=changed))
        return loop_margins(of, law, places_of(of, ["u9"]), draws=0).row(path)[0, 0]

    variance = 0.0
    for name in ("Y", "L", "N"):
        knots = corridor[name]
        slope = np.zeros(len(knots.regressors))
        for j in range(slope.size):
            step = 0.3 * knots.std_error[j, k]
            up, down = (knots.estimate.copy() for _ in range(2))
            up[j, k] += step
            down[j, k] -= step
            sides = [
                phase({**corridor.responses, name: replace(knots, estimate=values)}) for values in (up, down)
            ]
            slope[j] = (sides[0] - sides[1]) / (2 * step)
        variance += slope @ knots.covariance[k] @ slope
    _, low, high = found["u9"][path]
    assert (high - low) / 2 == pytest.approx(1.96 * np.sqrt(variance), rel=0.2)
    estimate = found["u9"][path][0]
    assert low < estimate < high


def test_a_trim_that_is_not_in_the_middle_leaves_less_travel(model, loop):
    assert model.reference(9.0, 1.1)["dr"][0] == pytest.approx(0.0, abs=1e-12)
    effectors = tuple(
        msgspec.structs.replace(e, limits=(-0.2, 0.6)) if e.name == "dr" else e
        for e in tilt_wing.VEHICLE.effectors
    )
    vehicle = msgspec.structs.replace(tilt_wing.VEHICLE, effectors=effectors)
    of = fq.GlobalModel(replace(model.corridor, aircraft=vehicle))
    estimate, low, high = fq.margins(of, loop, "u9", draws=20)["u9"]["trim/dr/travel_left"]
    assert estimate == pytest.approx(0.5)  # 0.2 of the 0.4 to the nearer side
    assert low <= estimate <= high
    assert high - low > 0


def test_another_model_stands_beside(model, loop):
    found = fq.margins(model, loop, ["u6", "u9"], draws=0, beside=[model])
    np.testing.assert_array_equal(found.beside["model"].estimate, found.estimate)
    assert np.isnan(found.lower).all()


def test_the_result_comes_back_from_its_file_and_shows_itself(found, tmp_path):
    back = fq.read(fq.save(found, tmp_path / "margins.h5"))
    assert back["u9"] == found["u9"]
    assert (back.stable == found.stable).all()
    assert repr(back) == repr(found)
    table = back.to_frame()
    row = table[(table.kind == "margins") & (table.of == "da") & (table.figure == "phase_deg")].iloc[0]
    assert (row.estimate, row.unit) == (found["u9"]["margins/da/phase_deg"][0], "deg")
    text = fq.page(back).html
    assert "attitude hold" in text
    assert "Disk margin" in text
    assert back.plot().axes


def test_what_cannot_be_done_is_said(model, loop):
    with pytest.raises(DataError, match="u = 40 m/s is outside the corridor"):
        fq.margins(model, loop, 40.0, draws=0)
    with pytest.raises(UsageError, match="the model has no point 'u7'"):
        fq.margins(model, loop, "u7")
    bare = {
        n: replace(k, covariance=np.zeros_like(k.covariance)) for n, k in model.corridor.responses.items()
    }
    of = fq.GlobalModel(replace(model.corridor, responses=bare))
    with pytest.raises(UsageError, match=r"states no covariance of 'X'.*draws=0"):
        fq.margins(of, loop)
    assert fq.margins(of, loop, "u9", draws=0).stable.all()
    with pytest.raises(UsageError, match="5 draws give no interval"):
        fq.margins(model, loop, draws=5)
    unknown = fq.GlobalModel(replace(model.corridor, aircraft=None))
    with pytest.raises(UsageError, match="does not say what its aircraft weighs"):
        fq.margins(unknown, loop)
    with pytest.raises(UsageError, match="found a dict, expected a point or a global model"):
        fq.margins({}, loop)


def test_an_unstable_loop_has_no_margins(model, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(margins_case.LOOP.replace("[signals]", "sign = -1\n[signals]", 1))
    found = fq.margins(model, path, "u9", draws=20)
    assert not found.stable[0]
    assert np.isnan(found.row("margins/da/phase_deg")[0]).all()
    assert "unstable at u9" in found.warnings[0]
    assert "Problem" in fq.page(found).html


def test_an_id_may_name_a_condition_of_a_scenario_that_is_no_point_of_the_model(model):
    between = Reference.of("u11", 11.0, 1.2, dw1=0.2)
    own = Reference.of("u9", 99.0, 1.2)
    found = places_of(model, ["u11", "u9"], (own, between))
    assert [(p.id, p.u, p.rho) for p in found] == [("u11", 11.0, 1.2), ("u9", 9.0, places_of(model)[1].rho)]
    assert found[0].scheduled == {"dw1": 0.2}
    with pytest.raises(UsageError, match="no point 'u12'"):
        places_of(model, ["u12"], (own, between))
