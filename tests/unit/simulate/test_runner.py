import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from freqid.core.errors import DataError, UsageError
from freqid.simulate import runner


def square(path, number, log=None):
    """Work that leaves a trace of being done, so that doing it twice shows."""
    if log:
        with open(log, "a") as file:
            file.write(f"{number}\n")
    if number < 0:
        raise DataError(f"number is {number}", remedy="give a positive one")
    path.write_text(json.dumps({"square": number**2}))


def divide(path, number):
    path.write_text(str(1 / number))


def results(paths):
    return [json.loads(path.read_text())["square"] for path in paths]


def units(numbers, log=None):
    return [{"number": n, "log": str(log)} if log else {"number": n} for n in numbers]


def test_results_come_in_the_order_of_the_inputs_and_are_listed(tmp_path):
    paths = runner.run_units(square, units([3, 1, 2, 1]), tmp_path)
    assert results(paths) == [9, 1, 4, 1]
    listing = json.loads((tmp_path / "units.json").read_text())
    assert {name: inputs["number"] for name, inputs in listing.items()} == {
        path.name: number for path, number in zip(paths, [3, 1, 2, 1], strict=True)
    }


def test_nothing_is_done_twice_and_new_inputs_are_added(tmp_path):
    log = tmp_path / "log"
    runner.run_units(square, units([1, 2], log), tmp_path / "r")
    assert results(runner.run_units(square, units([1, 2, 3, 3], log), tmp_path / "r")) == [1, 4, 9, 9]
    assert log.read_text().split() == ["1", "2", "3"]


def test_the_key_covers_function_inputs_scenario_and_release(tmp_path, monkeypatch):
    def key(work=square, number=1, **more):
        return runner.plan(work, [{"number": number}], tmp_path, **more)[0].key

    keys = [key(), key(divide), key(number=2), key(scenario_sha256="abc")]
    assert key() == keys[0]
    monkeypatch.setattr(runner, "__version__", "99.0")
    assert len({*keys, key()}) == 5


def double(path, source, scale=1.0, log=None):
    """Work on a file that another unit made."""
    if log:
        with open(log, "a") as file:
            file.write(f"{source.name}\n")
    path.write_text(json.dumps({"square": scale * 2 * json.loads(source.read_text())["square"]}))


def test_a_moved_folder_goes_on_and_a_changed_file_is_a_new_unit(tmp_path):
    log = tmp_path / "log"

    def chain(folder, log):
        beside = {"log": str(log)}
        first = runner.run_units(square, units([2, 3]), folder / "square", beside=beside)
        inputs = [{"source": path} for path in first]
        return runner.run_units(double, inputs, folder / "double", beside=beside)

    before = chain(tmp_path / "here", log)
    assert len(log.read_text().split()) == 4
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "here").rename(tmp_path / "elsewhere" / "there")
    after = chain(tmp_path / "elsewhere" / "there", tmp_path / "log 2")  # where things lie is no matter
    assert [p.name for p in after] == [p.name for p in before]
    assert results(after) == [8, 18]
    assert not (tmp_path / "log 2").exists()
    listing = (tmp_path / "elsewhere" / "there" / "double" / "units.json").read_text()
    assert str(tmp_path) not in listing

    source = tmp_path / "source.json"
    source.write_text('{"square": 1}')
    (first,) = runner.plan(double, [{"source": source}], tmp_path)
    source.write_text('{"square": 22}')
    (other,) = runner.plan(double, [{"source": source}], tmp_path)
    assert other.key != first.key
    with pytest.raises(DataError, match=r"absent.json: cannot be read"):
        runner.plan(double, [{"source": tmp_path / "absent.json"}], tmp_path)


def die_once(path, number, folder):
    """Work that kills its own process the first time that it is given number 2."""
    trace = Path(folder) / "died"
    if number == 2 and not trace.exists():
        trace.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    path.write_text(json.dumps({"square": number**2}))


def die(path, number):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_process_loses_no_result(tmp_path):
    paths = runner.run_units(
        die_once, [{"number": n} for n in range(5)], tmp_path / "r", beside={"folder": str(tmp_path)}, jobs=2
    )
    assert (tmp_path / "died").exists()
    assert results(paths) == [0, 1, 4, 9, 16]


def test_processes_that_are_killed_again_and_again_are_said_to_be(tmp_path):
    with pytest.raises(DataError, match="worker processes were killed 3 times"):
        runner.run_units(die, [{"number": n} for n in range(3)], tmp_path, jobs=2)


def test_failed_units_are_named_leave_nothing_and_are_tried_again(tmp_path):
    log = tmp_path / "log"
    with pytest.raises(
        DataError, match=r'2 of 4 units failed, first \{"number": -1, .*number is -1'
    ) as caught:
        runner.run_units(square, units([1, -1, -2, 2], log), tmp_path / "r")
    assert "finished units are kept" in str(caught.value)
    assert sorted(p.suffix for p in (tmp_path / "r").iterdir()) == [".json"] * 3  # two results and the list
    with pytest.raises(DataError):
        runner.run_units(square, units([1, -1, 2], log), tmp_path / "r")
    assert log.read_text().split() == ["1", "-1", "-2", "2", "-1"]


def test_a_bug_in_a_unit_is_named_with_its_line(tmp_path):
    with pytest.raises(DataError, match=r"ZeroDivisionError: division by zero \(test_runner.py:\d+\)"):
        runner.run_units(divide, units([0]), tmp_path)


def test_several_processes_do_the_same_and_report_progress(tmp_path):
    seen = []
    paths = runner.run_units(square, units(range(6)), tmp_path, jobs=2, progress=lambda *x: seen.append(x))
    assert results(paths) == [0, 1, 4, 9, 16, 25]
    assert seen == [(k, 6) for k in range(1, 7)]


def test_work_without_a_lasting_name_or_with_inputs_that_are_no_json_is_refused(tmp_path):
    with pytest.raises(UsageError, match=r"<lambda>' has no lasting name"):
        runner.run_units(lambda path: None, [{}], tmp_path)
    with pytest.raises(UsageError, match=r"inputs of unit 1 are no JSON values"):
        runner.run_units(square, [{"number": 1}, {"number": float("nan")}], tmp_path)
    with pytest.raises(UsageError, match=r"inputs of unit 0 are no JSON values"):
        runner.run_units(square, [{"number": {1, 2}}], tmp_path)


def test_a_killed_run_resumes_with_what_is_missing(tmp_path):
    (tmp_path / "slow_work.py").write_text(
        textwrap.dedent(
            """
            import sys, time
            from pathlib import Path
            from freqid.simulate import runner

            def work(path, number, log):
                with open(log, "a") as file:
                    file.write(f"{number}\\n")
                path.write_text("half")  # a kill now must not leave this as a result
                time.sleep(30 if number == 3 and not Path(log + ".fast").exists() else 0)
                path.write_text(str(number))

            def main(log, folder):
                return runner.run_units(work, [{"number": n, "log": log} for n in range(6)], Path(folder))
            """
        )
    )
    log, folder = tmp_path / "log", tmp_path / "r"
    command = [sys.executable, "-c", f"import slow_work; slow_work.main({str(log)!r}, {str(folder)!r})"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    first = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not (log.exists() and "3" in log.read_text().split()) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(first.pid, signal.SIGKILL)
    assert first.wait() == -signal.SIGKILL
    done = {path.read_text() for path in folder.glob("[0-9a-f]*.json")}
    assert done == {"0", "1", "2"}
    Path(f"{log}.fast").touch()
    subprocess.run(command, env=environment, check=True, stderr=subprocess.DEVNULL)
    assert log.read_text().split() == ["0", "1", "2", "3", "3", "4", "5"]
    assert {path.read_text() for path in folder.glob("[0-9a-f]*.json")} == set("012345")
