"""An FMU that is compiled here: algebraic pitching moment, and an actuator of first order."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.gap.connect import connect

fmpy = pytest.importorskip("fmpy", reason="the extra 'fmu' is not installed")
COMPILER = shutil.which("cc")
if COMPILER is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

NAMES = ("state.q", "de", "command.de", "M", "effector.de")
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="pitch" guid="{{pitch}}">
  <CoSimulation modelIdentifier="pitch" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>{variables}</ModelVariables>
  <ModelStructure><Outputs><Unknown index="4"/><Unknown index="5"/></Outputs></ModelStructure>
</fmiModelDescription>"""
SOURCE = r"""
#include <stdlib.h>
#include <math.h>
typedef struct { double v[5]; } Unit;
void* fmi2Instantiate(const char* n, int t, const char* g, const char* r, const void* f, int v, int l)
{ return calloc(1, sizeof(Unit)); }
void fmi2FreeInstance(void* c) { free(c); }
const char* fmi2GetVersion(void) { return "2.0"; }
const char* fmi2GetTypesPlatform(void) { return "default"; }
int fmi2SetDebugLogging(void* c, int on, size_t n, const char* const k[]) { return 0; }
int fmi2SetupExperiment(void* c, int td, double tol, double start, int sd, double stop) { return 0; }
int fmi2EnterInitializationMode(void* c) { return 0; }
static void outputs(Unit* u) { u->v[3] = -3.0 * u->v[0] + 40.0 * u->v[1]; }
int fmi2ExitInitializationMode(void* c) { Unit* u = c; u->v[4] = u->v[2]; outputs(u); return 0; }
int fmi2Terminate(void* c) { return 0; }
int fmi2Reset(void* c) { return 0; }
int fmi2SetReal(void* c, const unsigned r[], size_t n, const double x[])
{ for (size_t i = 0; i < n; i++) ((Unit*)c)->v[r[i]] = x[i]; return 0; }
int fmi2GetReal(void* c, const unsigned r[], size_t n, double x[])
{ for (size_t i = 0; i < n; i++) x[i] = ((Unit*)c)->v[r[i]]; return 0; }
int fmi2DoStep(void* c, double t, double h, int no)
{ Unit* u = c; u->v[4] += (u->v[2] - u->v[4]) * (1 - exp(-h / 0.1)); outputs(u); return 0; }
"""
UNUSED = """GetInteger GetBoolean GetString SetInteger SetBoolean SetString GetFMUstate SetFMUstate
FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
SetRealInputDerivatives GetRealOutputDerivatives CancelStep GetStatus GetRealStatus GetIntegerStatus
GetBooleanStatus GetStringStatus"""


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    (folder / "pitch.c").write_text(
        SOURCE + "".join(f"int fmi2{n}(void) {{ return 0; }}\n" for n in UNUSED.split())
    )
    library = folder / "pitch.so"
    subprocess.run([str(COMPILER), "-shared", "-fPIC", "-o", library, folder / "pitch.c", "-lm"], check=True)
    kinds = [("input", ' start="0"')] * 3 + [("output", "")] * 2
    variables = "".join(
        f'<ScalarVariable name="{name}" valueReference="{i}" causality="{kind}">'
        f"<Real{start}/></ScalarVariable>"
        for i, (name, (kind, start)) in enumerate(zip(NAMES, kinds, strict=True))
    )
    with zipfile.ZipFile(folder / "pitch.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(variables=variables))
        archive.write(library, "binaries/linux64/pitch.so")
    return folder / "pitch.fmu"


@pytest.fixture(scope="module")
def record():
    time = np.arange(101) / 50
    signals = {
        "state/q": ("rad/s", 0.1 * np.sin(3 * time)),
        "effector/de": ("rad", 0.05 * np.cos(5 * time)),
        "command/de": ("rad", np.where(time < 0.5, 0.0, 0.1)),
    }
    return FlightRecord(time, {n: Channel(n, u, v, 50.0, "made") for n, (u, v) in signals.items()})


def test_an_fmu_answers_on_the_records_samples(unit, record):
    simulation = connect(str(unit))
    assert simulation.responses == ("M",)
    expected = -3 * record["state/q"] + 40 * record["effector/de"]
    assert np.allclose(simulation.predict(record), expected, atol=1e-12)
    slopes = simulation.gradient(record, ["state/q", "effector/de"])
    assert np.allclose(slopes, np.array([-3.0, 40.0])[None, :, None], atol=1e-9)


def test_its_actuator_follows_the_commands(unit, record):
    found = connect(str(unit)).positions(record)["de"]
    after = np.maximum(record.time - 0.5 + record.dt, 0.0)  # a step is taken with the input at its end
    assert np.allclose(found, 0.1 * (1 - np.exp(-after / 0.1)) * (record.time >= 0.5), atol=1e-9)


def test_a_record_without_an_input_of_the_fmu_is_refused(unit, record):
    short = FlightRecord(record.time, {"state/q": record.channel("state/q")})
    with pytest.raises(DataError, match="no channel for input 'de'"):
        connect(str(unit)).predict(short)


def test_an_fmu_of_another_machine_is_refused(unit, tmp_path):
    with zipfile.ZipFile(unit) as whole, zipfile.ZipFile(tmp_path / "pitch.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", whole.read("modelDescription.xml"))
        archive.writestr("binaries/win64/pitch.dll", b"")
    with pytest.raises(DataError, match="has no binary for linux64, only for win64"):
        connect(str(tmp_path / "pitch.fmu"))
