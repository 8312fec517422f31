"""The c172p flown by JSBSim itself, and the adapter laid beside that flight."""

import re
from dataclasses import replace

import numpy as np
import pytest

from freqid.core.channels import si_unit
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.gap.connect import connect

jsbsim = pytest.importorskip("jsbsim", reason="JSBSim is not installed")

FOOT, POUND, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
POSITION = {
    "elevator": "fcs/elevator-pos-rad",
    "aileron": "fcs/left-aileron-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
    "throttle": "fcs/throttle-pos-norm",
}
KINDS = dict.fromkeys(("elevator", "aileron", "rudder"), "surface") | {"throttle": "throttle"}


def seen(fdm, excitation):
    row = {f"state/{n}": FOOT * fdm[f"velocities/{n}-fps"] for n in "uvw"}
    row |= {f"state/{n}": fdm[f"velocities/{n}-rad_sec"] for n in "pqr"}
    row |= {f"state/{n}": fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")}
    row |= {
        "state/alt": FOOT * fdm["position/h-sl-ft"],
        "air/rho": 515.378818 * fdm["atmosphere/rho-slugs_ft3"],
    }
    for axis, force, moment in zip("xyz", "XYZ", "LMN", strict=True):
        loads = fdm[f"forces/fb{axis}-aero-lbs"] + fdm[f"forces/fb{axis}-prop-lbs"]
        about = moment.lower()
        turning = fdm[f"moments/{about}-aero-lbsft"] + fdm[f"moments/{about}-prop-lbsft"]
        row[f"response/{force}"], row[f"response/{moment}"] = POUND * loads, POUND * FOOT * turning
    for name, value in zip(POSITION, excitation, strict=True):
        row[f"effector/{name}"] = fdm[POSITION[name]]
        trim = fdm["fcs/pitch-trim-cmd-norm"] if name == "elevator" else 0.0
        row[f"command/{name}"] = fdm[f"fcs/{name}-cmd-norm"] + trim
        row[f"excitation/{name}"] = value
    return row


def flown(aircraft, speed_fps, height_ft):
    """Return ten seconds from trim, excited on all controls; loads as JSBSim had them."""
    fdm, rate, duration = jsbsim.FGFDMExec(None), 50, 10.0
    fdm.set_debug_level(0)
    fdm.load_model(aircraft)
    fdm.set_dt(0.01)
    for name, value in {"h-sl-ft": height_ft, "vt-fps": speed_fps, "gamma-deg": 0.0}.items():
        fdm[f"ic/{name}"] = value
    fdm["fcs/mixture-cmd-norm"] = 1.0
    second = "fcs/throttle-pos-norm[1]" in str(fdm.query_property_catalog("fcs/"))
    fdm["propulsion/set-running"] = -1
    fdm.run_ic()
    fdm["simulation/do_simple_trim"] = 1
    time, rng = np.arange(round(rate * duration) + 1) / rate, np.random.default_rng(0)
    lines = np.arange(2, 14)[:, None]
    signals = 0.01 * np.array(
        [
            np.sin(2 * np.pi * lines[i::4] * time / duration + rng.uniform(0, 6, lines[i::4].shape)).sum(
                axis=0
            )
            for i in range(4)
        ]
    )
    signals -= signals[:, :1]
    trim = [fdm[f"fcs/{n}-cmd-norm"] for n in POSITION]
    rows = [seen(fdm, signals[:, 0])]
    for k in range(1, time.size):
        for share in (0.5, 1.0):
            now = signals[:, k - 1] + share * (signals[:, k] - signals[:, k - 1])
            for name, value in zip(POSITION, trim + now, strict=True):
                fdm[f"fcs/{name}-cmd-norm"] = float(value)
            if second:
                fdm["fcs/throttle-cmd-norm[1]"] = fdm["fcs/throttle-cmd-norm"]
            fdm.run()
        rows.append(seen(fdm, signals[:, k]))
    channels = {}
    for name in rows[0]:
        unit = "1" if name.startswith(("command", "excitation")) else si_unit(name, KINDS) or "1"
        channels[name] = Channel(name, unit, np.array([row[name] for row in rows]), float(rate), "JSBSim")
    return FlightRecord(time, channels)


@pytest.fixture(scope="module")
def record():
    return flown("c172p", 170.0, 3000.0)


@pytest.fixture(scope="module")
def simulation():
    return connect("jsbsim:c172p")


def test_the_replayed_wrench_is_jsbsims_own(simulation, record):
    truth = record.matrix(f"response/{n}" for n in "XYZLMN")
    error = (simulation.predict(record) - truth).std(axis=1) / truth.std(axis=1)
    # The pitching moment follows the rate of the angle of attack, which a standing state does not tell.
    assert (error < [0.01, 0.001, 0.005, 0.005, 0.05, 0.005]).all()


def test_its_control_system_makes_the_positions(simulation, record):
    found = simulation.positions(record)
    assert set(found) == set(POSITION)
    for name, row in found.items():
        assert np.abs(row - record[f"effector/{name}"]).max() < 1e-6, name


def test_its_own_flight_is_the_record(simulation, record):
    found = simulation.fly(record)
    for name, tolerance in {"u": 0.01, "w": 0.03, "q": 0.003, "theta": 0.001}.items():
        assert np.abs(found[name] - record[f"state/{name}"]).max() < tolerance, name


def test_without_commands_it_flies_by_itself(simulation, record):
    """As a log has them that holds positions alone."""
    channels = {n: c for n, c in record.channels.items() if not n.startswith("command/")}
    flown = simulation.fly(FlightRecord(record.time, channels, record.vehicle))
    assert all(np.isfinite(x).all() for x in flown.values())


def test_derivatives_are_those_of_the_prediction(simulation, record):
    short = record.cut(0.0, 2.0)
    found = simulation.gradient(short, ["effector/elevator", "state/phi"])
    above, below = (
        simulation.predict(
            short.with_channels(
                replace(short.channel("effector/elevator"), values=short["effector/elevator"] + step)
            )
        )
        for step in (0.01, -0.01)
    )
    slope = ((above - below) / 0.02)[4]
    assert np.allclose(found[4, 0], slope, rtol=0.02)
    assert np.abs(found[:, 1]).max() < 1e-4 * np.abs(slope).max()  # but for the Earth's rotation


def test_an_edited_copy_flies_as_edited(simulation, record, tmp_path):
    source = simulation.aircraft.file.read_text()
    edited, count = re.subn(r"<value>\s*-1\.122\d*\s*</value>", "<value>-0.561</value>", source)
    assert count == 1, "the aircraft's file has another elevator"
    folder = tmp_path / "weak"
    folder.mkdir()
    (folder / "weak.xml").write_text(edited)
    weak = connect(f"jsbsim:{folder / 'weak.xml'}")
    short = record.cut(0.0, 1.0)
    ours, theirs = (s.gradient(short, ["effector/elevator"])[4, 0].mean() for s in (weak, simulation))
    assert ours == pytest.approx(0.5 * theirs, rel=0.05)


def test_the_vehicle_is_described_without_rotors(simulation):
    vehicle = simulation.vehicle
    assert vehicle.mass_properties.mass_kg == pytest.approx(853, rel=0.01)
    assert vehicle.span_m == pytest.approx(35.8 * FOOT)
    assert {e.name for e in vehicle.effectors} == set(POSITION)
    assert vehicle.effector("elevator").limits == pytest.approx((np.radians(-28), np.radians(23)), rel=1e-3)
    assert vehicle.rotors == ()


def test_what_jsbsim_does_not_have_is_said(simulation, record):
    with pytest.raises(DataError, match="no aircraft 'c999'"):
        connect("jsbsim:c999")
    odd = record.with_channels(replace(record.channel("effector/rudder"), name="effector/fin"))
    with pytest.raises(DataError, match="no effector 'fin'"):
        simulation.predict(odd)


def test_all_engines_and_the_yaw_damper_of_the_737_are_its_own():
    """Flown from trim with multisines; the aircraft's damper adds a quarter to the rudder's motion."""
    record = flown("737", 600.0, 10000.0)
    simulation = connect("jsbsim:737")
    assert len(simulation.aircraft.where("throttle")) == 2
    assert simulation.aircraft.where("throttle2") == [("fcs/throttle-pos-norm[1]", 1.0)]
    truth = record.matrix(f"response/{n}" for n in "XYZLMN")
    error = simulation.predict(record) - truth
    assert (error.std(axis=1) < 0.01 * truth.std(axis=1)).all()
    assert abs(error[0].mean()) < 0.01 * abs(truth[0].mean())  # the thrust of both
    for name, row in simulation.positions(record).items():
        assert np.abs(row - record[f"effector/{name}"]).max() < 2e-4, name
    own = simulation.fly(record)
    for name, tolerance in {"v": 0.02, "p": 5e-4, "r": 5e-4, "u": 0.002}.items():
        assert np.abs(own[name] - record[f"state/{name}"]).max() < tolerance, name


def test_nothing_is_printed(record, capfd):
    simulation = connect("jsbsim:c172p")
    short = record.cut(0.0, 0.5)
    for ask in (simulation.predict, simulation.positions, simulation.fly):
        ask(short)
    simulation.gradient(short, ["state/w"])
    assert capfd.readouterr() == ("", "")


def test_a_file_that_jsbsim_cannot_load_is_said_with_its_reason(tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<fdm_config name='broken'><metrics></fdm_config>")
    with pytest.raises(DataError, match=r"cannot load it \(.+\)"):
        connect(f"jsbsim:{broken}")


def test_it_has_no_parameters_of_its_own_to_be_off(simulation, record):
    assert simulation.tolerances == {}
    assert (simulation.can_fly, simulation.has_actuators, simulation.gyroscopic) == (True, True, False)
    with pytest.raises(UsageError, match="no parameter 'mass' of its own"):
        simulation.predict(record, departures={"mass": 0.1})
