"""Exported designs, read back, compiled and run by the tools they are for."""

import csv
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from linear_design import design
from scipy.io import loadmat

from freqid.core.errors import DataError, UsageError
from freqid.core.results.design import Multisine, SampledInputs
from freqid.design.export import write_c_header, write_csv, write_lua, write_mat

# Inside, on samples, between them, near both ends, outside.
TIMES = np.concatenate([[-0.01, 0.0, 1e-9, 40.0, 40.01, 39.999], np.linspace(0, 40, 301), [13.37]])


@pytest.fixture(scope="module")
def flown():
    """Two periods of 20 s; one signal has a single tone, one a name that has to be quoted."""
    made = design()
    odd = Multisine('a"\\b', "1", np.array([29]), np.array([1e-7]), np.array([-3.0]))
    return replace(made, signals=(*made.signals, odd), band_hz=(0.1, 1.6))


def expected(flown, times):
    """The sum of sines, straight from its definition; zero outside."""
    values = [
        [s.amplitude @ np.sin(2 * np.pi * s.index * t / flown.period_s + s.phase) for t in times]
        for s in flown.signals
    ]
    inside = (times >= 0) & (times <= flown.duration_s)
    return np.array(values) * inside


def sampled(flown):
    time = 0.02 * np.arange(501)
    return SampledInputs(flown.names, tuple(s.unit for s in flown.signals), time, expected(flown, time))


def assert_reproduced(got, flown):
    truth = expected(flown, TIMES)
    peak = np.abs(truth).max(axis=1, keepdims=True)
    assert (np.abs(got - truth) <= 1e-6 * peak).all()
    np.testing.assert_array_equal(got[:, TIMES < 0], 0.0)
    np.testing.assert_array_equal(got[:, TIMES > 40], 0.0)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler (cc) here")
def test_the_c_header_compiles_without_warnings_and_reproduces_the_signals(flown, tmp_path):
    write_c_header(tmp_path / "multisine.h", flown)
    (tmp_path / "main.c").write_text(
        """
        #include <stdio.h>
        #include "multisine.h"
        int main(void) {
            double t;
            int i;
            for (i = 0; i < MULTISINE_SIGNALS; i++) printf("%s %s\\n", multisine_name(i), multisine_unit(i));
            printf("%g %g [%s] %g\\n", MULTISINE_PERIOD_S, MULTISINE_DURATION_S, multisine_name(-1),
                   multisine_value(MULTISINE_SIGNALS, 1.0));
            while (scanf("%lf", &t) == 1)
                for (i = 0; i < MULTISINE_SIGNALS; i++) printf("%.17g\\n", multisine_value(i, t));
            return 0;
        }
        """
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    build = ["cc", *flags, "main.c", "-lm", "-o", "main"]
    subprocess.run(build, cwd=tmp_path, check=True, timeout=60)
    # Two files may include it, and one that uses nothing of it must not warn.
    (tmp_path / "idle.c").write_text('#include "multisine.h"\n#include "multisine.h"\nint idle;\n')
    subprocess.run(["cc", *flags, "-c", "idle.c"], cwd=tmp_path, check=True, timeout=60)

    told = "\n".join(repr(float(t)) for t in TIMES)
    run = subprocess.run(
        [tmp_path / "main"], input=told, capture_output=True, text=True, check=True, timeout=60
    )
    lines = run.stdout.splitlines()
    assert lines[:5] == ["de rad", "da rad", "dr rad", "n1 rad/s", 'a"\\b 1']
    assert lines[5] == "20 40 [] 0"
    assert_reproduced(np.array(lines[6:], dtype=float).reshape(TIMES.size, 5).T, flown)


def test_two_headers_live_together_under_prefixes_of_their_own(flown, tmp_path):
    write_c_header(tmp_path / "swapped.h", flown, prefix="swapped")
    text = (tmp_path / "swapped.h").read_text()
    assert "multisine_" not in text
    assert "double swapped_value(int signal, double t)" in text
    with pytest.raises(UsageError, match="prefix '2nd' is no C identifier"):
        write_c_header(tmp_path / "x.h", flown, prefix="2nd")


@pytest.mark.parametrize("version", ["lua53", "lua54"])
def test_the_lua_table_runs_and_reproduces_the_signals(flown, tmp_path, version):
    lupa = pytest.importorskip(f"lupa.{version}")
    write_lua(tmp_path / "multisine.lua", flown)
    module = lupa.LuaRuntime().execute((tmp_path / "multisine.lua").read_text())
    got = [[module.value(i + 1, float(t)) for t in TIMES] for i in range(5)]
    assert_reproduced(np.array(got), flown)
    assert [module.signals[i + 1].name for i in range(5)] == list(flown.names)
    assert (module.signals[4].unit, module.period_s, module.duration_s) == ("rad/s", 20.0, 40.0)
    assert module.value(6, 1.0) == 0.0


def test_csv_keeps_every_digit(flown, tmp_path):
    inputs = sampled(flown)
    write_csv(tmp_path / "design.csv", inputs)
    with (tmp_path / "design.csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["time_s", "de_rad", "da_rad", "dr_rad", "n1_rad/s", 'a"\\b_1']
    got = np.array(rows, dtype=float).T
    np.testing.assert_array_equal(got, np.vstack([inputs.time, inputs.values]))


def test_matlab_files_hold_columns_and_are_the_same_every_time(flown, tmp_path):
    inputs = sampled(flown)
    for name in ("a.mat", "b.mat"):
        write_mat(tmp_path / name, inputs)
    got = loadmat(tmp_path / "a.mat")
    np.testing.assert_array_equal(got["t"], inputs.time[:, None])
    np.testing.assert_array_equal(got["u"], inputs.values.T)
    assert [str(cell.item()) for cell in got["names"][0]] == list(inputs.names)
    assert [str(cell.item()) for cell in got["units"][0]] == list(inputs.units)
    content = (tmp_path / "a.mat").read_bytes()
    assert content.startswith(b"MATLAB 5.0 MAT-file, written by freqid ")
    assert content == (tmp_path / "b.mat").read_bytes()


def test_files_are_replaced_whole_or_not_at_all(flown, tmp_path):
    target = tmp_path / "design.lua"
    target.write_text("old")
    broken = replace(flown, signals=(replace(flown.signals[0], name="bell\a"),))
    with pytest.raises(UsageError, match="unprintable"):
        write_lua(target, broken)
    assert target.read_text() == "old"
    with pytest.raises(DataError, match="cannot be written"):
        write_csv(target / "inside" / "x.csv", sampled(flown))
    assert [path.name for path in tmp_path.iterdir()] == ["design.lua"]
