"""What readers make of damaged files: thousands of mutations of a good file for each of them.

Every case ends as one of: *refused* (one sentence, exit code 2 or 3), *same* (read, and nothing in it is
different: the damage hit what is not read), *other* (read, with other contents: only a format with a
checksum can tell), or as a fault: *traceback*, *warning* (of numpy, say), *hang* (over 5 s of processor),
*memory* (over 1 GiB more than before), *crash* (the process ended).

Run as ``python benchmarks/fuzz.py``; ``--cases 200`` for fewer, ``--only csv`` for the readers of a pattern,
``--show`` for the cases that are faults, ``--case 17`` for one of them, ``--jobs 1`` for one reader at once.

Each case is made from its number alone. Readers run in a process of their own, with the limits on it; a
process that ends is replaced and the case that ended it is counted. Whole commands are tried too: they
must end with exit code 0, 2, 3 or 4, and say one sentence where they refuse.
"""

import argparse
import contextlib
import csv
import hashlib
import importlib.util
import io
import mmap
import multiprocessing
import os
import re
import resource
import signal
import struct
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

import freqid as fq
from freqid.blend.global_model import GlobalModel
from freqid.core.errors import FreqidError, UncheckedFile

PROJECT = Path(__file__).resolve().parents[1]
OUTCOMES = ("refused", "same", "other", "traceback", "warning", "hang", "memory", "crash")
FAULTS = OUTCOMES[3:]
SECONDS, BYTES = 5.0, 1 << 30
NASTY = b"0 -1 1 2 1e308 -1e308 1e-308 nan inf -inf 1e9 99999999999 1e20 0.1 3 true '' [] {}".split()


@dataclass(frozen=True)
class Subject:
    """One reader and a good file of its kind.

    Attributes
    ----------
    name, suffix : str
    good : bytes
    read : callable
        ``read(path)``, whose result is compared.
    text : bool
        Whether numbers and lines are mutated, beside bytes.
    share : float
        Of the number of cases that is asked for: less where one takes long.
    after : callable, optional
        Done to the mutated bytes: what one who means harm would do.
    """

    name: str
    suffix: str
    good: bytes
    read: Callable[[Path], Any]
    text: bool = False
    share: float = 1.0
    after: Callable[[bytes], bytes] = bytes


class Hang(BaseException):
    """No `Exception`, so that no reader takes it for damage."""


class Refused(FreqidError):
    """What a command said with exit code 2 or 3."""

    exit_code = 3

    def __init__(self, said: str) -> None:
        self.said = said

    def __str__(self) -> str:
        return self.said


def _hang(*_: object) -> None:
    raise Hang


def mutated(good: bytes, rng: np.random.Generator, text: bool) -> bytes:
    """Return a file with one to three changes: bytes, blocks, its end; of text also numbers and lines."""
    out = bytearray(good)
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        kind = int(rng.choice([7, 8, 9]) if text and rng.random() < 0.6 else rng.integers(0, 7))
        at = int(rng.integers(0, max(len(out), 1)))
        size = int(rng.integers(1, 65))
        match kind:
            case 0:
                if out:
                    out[at] ^= 1 << int(rng.integers(0, 8))
            case 1:
                if out:
                    out[at] = int(rng.integers(0, 256))
            case 2:
                out[at : at + size] = rng.bytes(size)
            case 3:
                out[at : at + size] = bytes([int(rng.choice([0, 255]))]) * size
            case 4:
                del out[at : at + size]
            case 5:
                there = int(rng.integers(0, max(len(out), 1)))
                out[there:there] = out[at : at + size]
            case 6:
                if rng.random() < 0.3:
                    del out[at:]
                else:  # a number of four or eight bytes that is extreme
                    width = int(rng.choice([4, 8]))
                    value = int(rng.choice([0, 1, 2**31 - 1, 2**31, 2**32 - 1])) << (32 if width == 8 else 0)
                    out[at : at + width] = struct.pack("<Q", value)[:width]
            case 7 | 8:
                numbers = list(re.finditer(rb"(?<![\w.-])-?\d[\d.e+-]*", bytes(out)))
                if numbers:
                    there = numbers[int(rng.integers(0, len(numbers)))]
                    out[slice(*there.span())] = NASTY[int(rng.integers(0, len(NASTY)))]
            case 9:
                lines = bytes(out).split(b"\n")
                i, j = rng.integers(0, len(lines), 2)
                match int(rng.integers(0, 3)):
                    case 0:
                        del lines[i]
                    case 1:
                        lines.insert(j, lines[i])
                    case 2:
                        lines[i], lines[j] = lines[j], lines[i]
                out = bytearray(b"\n".join(lines))
    return bytes(out)


def contents(value: Any) -> Any:
    """Return a result as something that is equal where, and only where, all numbers and texts in it are."""
    if isinstance(value, np.ndarray):
        return (str(value.dtype), value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).digest())
    if is_dataclass(value) and not isinstance(value, type):
        return tuple((f.name, contents(getattr(value, f.name))) for f in fields(value) if f.compare)
    if isinstance(value, msgspec.Struct):
        names = [n for n in value.__struct_fields__ if n not in ("sha256", "file")]
        return tuple((n, contents(getattr(value, n))) for n in names)
    if isinstance(value, GlobalModel):
        return contents(value.corridor)
    if isinstance(value, Mapping):
        return tuple((str(k), contents(v)) for k, v in value.items())
    if isinstance(value, list | tuple):
        return tuple(map(contents, value))
    if hasattr(value, "__dict__") and not callable(value) and not isinstance(value, Path):
        return tuple((n, contents(v)) for n, v in vars(value).items())
    return repr(value)


def outcome(subject: Subject, content: bytes, folder: Path, expected: Any) -> tuple[str, str]:
    """Read one file; return what became of it, and where it is a fault, what was raised."""
    path = folder / f"case{subject.suffix}"
    path.write_bytes(content)
    before, used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, processor()
    signal.signal(signal.SIGPROF, _hang)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        found = subject.read(path)
        result = ("same" if contents(found) == expected else "other", "")
    except FreqidError as error:
        said = str(error)
        fault = "\n" in said or not said.startswith(str(path)) or error.exit_code not in (2, 3)
        result = ("traceback", f"not one sentence of the file: {said!r}") if fault else ("refused", said)
    except Hang:
        result = ("hang", " < ".join(f.name for f in traceback.extract_stack()[-1:]))
    except MemoryError:
        result = ("memory", "MemoryError")
    except Warning as warning:
        at = traceback.extract_tb(warning.__traceback__)[-1]
        result = ("warning", f"{warning!r} {at.filename}:{at.lineno}")
    except BaseException as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        result = ("traceback", f"{error!r} {at.filename}:{at.lineno}")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > BYTES >> 10:
        return "memory", result[1]
    return ("hang", "in a process of its own") if processor() - used > SECONDS else result


def processor() -> float:
    """Return the seconds of processor that this process and those that it waited for have used."""
    own, others = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def processor_of(process: int) -> float:
    """Return the seconds of processor that another process has used."""
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def case_of(subject: Subject, number: int) -> bytes:
    """Return the bytes of one case."""
    seed = [number, int.from_bytes(hashlib.sha256(subject.name.encode()).digest()[:4], "little")]
    return subject.after(mutated(subject.good, np.random.default_rng(seed), subject.text))


def work(subject: Subject, first: int, stop: int, seen: mmap.mmap, log: Path) -> None:
    """Do cases in this process, under its limits; say in shared memory which one is being done."""
    folder = Path(tempfile.mkdtemp(prefix="case", dir=log.parent))
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", UncheckedFile)
    good = folder / f"good{subject.suffix}"
    good.write_bytes(subject.good)
    expected = contents(subject.read(good))
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES + (BYTES >> 2), resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with log.open("a") as out:
        for number in range(first, stop):
            seen[:16] = struct.pack("<qd", number, processor())
            became, said = outcome(subject, case_of(subject, number), folder, expected)
            out.write(f"{number}\t{became}\t{' '.join(said.split())}\n")
            out.flush()


def run(subject: Subject, cases: int, folder: Path) -> list[tuple[int, str, str]]:
    """Return number, outcome and words of all cases of a reader."""
    log = folder / "log.tsv"
    log.write_text("")
    seen = mmap.mmap(-1, 16)
    ended: list[tuple[int, str, str]] = []
    first = 0
    while first < cases:
        seen[:16] = struct.pack("<qd", first, 60.0)  # until it is ready
        child = os.fork()
        if child == 0:
            code = 1
            try:
                work(subject, first, cases, seen, log)
                code = 0
            except BaseException:
                log.with_suffix(".err").write_text(traceback.format_exc())
            finally:
                os._exit(code)
        hung, status = False, 0
        while True:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                break
            if processor_of(child) - struct.unpack("<qd", seen[:16])[1] > SECONDS + 1:  # no Python is run
                hung = True
                os.kill(child, signal.SIGKILL)
            time.sleep(0.05)
        if status == 0:
            break
        number = struct.unpack("<qd", seen[:16])[0]
        if os.WIFEXITED(status) and log.with_suffix(".err").exists():
            raise RuntimeError(log.with_suffix(".err").read_text())
        ended.append((number, "hang" if hung else "crash", f"status {status}"))
        first = number + 1
    rows = [line.split("\t") for line in log.read_text().splitlines()]
    return sorted([(int(n), became, said) for n, became, said in rows] + ended)


def resealed(content: bytes) -> bytes:
    """Return a damaged file with the checksum that its bytes have."""
    digest = hashlib.sha256(content[512:]).hexdigest().encode()
    return re.sub(rb"\b[0-9a-f]{64}\b", digest, content[:512]) + content[512:]


def subjects(folder: Path) -> list[Subject]:
    """Return all readers with a good file each."""
    return [*_logs(folder), *_tables(folder), *_results(folder), *_commands(folder)]


def _commands(folder: Path) -> list[Subject]:
    """Return whole commands; what they write goes beside the damaged file."""
    from freqid.cli.main import _exit_code

    def command(*words: str) -> Callable[[Path], Any]:
        def read(path: Path) -> Any:
            heard = io.StringIO()
            asked = [w.replace("FILE", str(path)).replace("OUT", str(path.with_name("out"))) for w in words]
            with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(io.StringIO()):
                code = _exit_code(asked)
            said = heard.getvalue().strip().removeprefix("freqid: ")
            if code in (2, 3):
                raise Refused(said)
            if code not in (0, 4):
                raise RuntimeError(f"exit code {code}: {said}")
            return code

        return read

    scenarios = PROJECT / "scenarios"
    linear = str(scenarios / "linear.toml")
    check = command("check", "FILE", "--no-draw")
    design = command("design-inputs", "FILE", "--no-page", "--no-study", "-o", "OUT.h5")
    maps = ("--map", str(folder / "a.toml"), "--scenario", linear)
    (folder / "a.toml").write_text(
        '[time]\ncolumn = "t"\nunit = "s"\n'
        + "".join(
            f'[[channel]]\nname = "{n}"\ncolumn = "{c}"\nunit = "deg"\n'
            for n, c in {"state/theta": "q", "effector/de": "x"}.items()
        )
    )
    files = {n: (folder / f"{n}.h5").read_bytes() for n in ("record", "gap")}
    made = {
        "check": (".toml", (scenarios / "tiltrotor.toml").read_bytes(), check, True),
        "design-inputs": (".toml", Path(linear).read_bytes(), design, True),
        "import-log": (
            ".csv",
            (folder / "a.csv").read_bytes(),
            command("import-log", "FILE", *maps, "-o", "OUT.h5"),
            True,
        ),
        "export": (
            ".h5",
            files["record"],
            command("export", "FILE", "--to", "mat", "--overwrite", "-o", "OUT.mat"),
            False,
        ),
        "report": (".h5", files["gap"], command("report", "FILE", "-o", "OUT.html"), False),
    }
    return [
        Subject(f"command {name}", suffix, good, read, text, share=0.2 if name == "design-inputs" else 1.0)
        for name, (suffix, good, read, text) in made.items()
    ]


def _results(folder: Path) -> list[Subject]:
    out = []
    warnings.simplefilter("ignore", UncheckedFile)
    for kind in ("record", "design", "point", "global", "response", "gap", "rivals"):
        old = PROJECT / "tests" / "unit" / "core" / "results" / "files" / f"{kind}.h5"
        path = folder / f"{kind}.h5"
        fq.save(fq.read(old), path)
        new = path.read_bytes()
        out.append(Subject(kind, ".h5", new, fq.read))
        out.append(Subject(f"{kind}, resealed", ".h5", new, fq.read, share=0.02, after=resealed))
        name = f"{kind}, of a release without checksums"
        out.append(Subject(name, ".h5", old.read_bytes(), fq.read, share=0.02))
    return out


def _makers(name: str) -> Any:
    """Return a module of the tests that makes logs."""
    spec = importlib.util.spec_from_file_location(
        name, PROJECT / "tests" / "unit" / "flightlog" / f"{name}.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _simulink(folder: Path) -> list[Subject]:
    """Return logs whose signals are objects: a timeseries and a timetable beside a Dataset with a bus."""
    from freqid.flightlog.column_map import ChannelPlace, ColumnMap, TimePlace
    from freqid.flightlog.read import read_log

    if importlib.util.find_spec("matio") is None:
        return []
    makers = _makers("simulink_logs")
    time_s = np.arange(100) / 50
    uniform = makers.regular(makers.duration(0.0), makers.duration(0.02), 50)
    held = {
        "q": makers.timeseries(np.sin(time_s), time_s, unit="deg/s"),
        "rows": makers.timetable(
            makers.moment(1e3 * time_s),
            {"r": np.cos(time_s), "x": np.sin(time_s)},
            ["deg/s", "deg"],
            version=8,
        ),
        "out": makers.output(
            logsout=makers.dataset(
                makers.element(makers.timeseries(np.cos(time_s), uniform=(0.0, 0.02)), "theta"),
                makers.element(makers.struct(p=makers.timeseries(np.sin(time_s), time_s)), "rates"),
                makers.element(makers.timetable(uniform, {"Data": np.sin(time_s)}), "flap"),
            )
        ),
    }
    logs = "out.logsout"
    rates = {"q": "q.Data", "p": f"{logs}.rates.p.Data", "r": "rows.r"}
    others = {
        **{"state/theta": f"{logs}.theta.Data", "effector/x": "rows.x", "effector/flap": f"{logs}.flap.Data"},
        **{"effector/t1": "q.Time", "effector/t2": f"{logs}.flap.Time"},  # clocks are compared too
    }
    column_map = ColumnMap(
        time=TimePlace(variable="rows.Time", unit="s", epoch="unix"),
        channel=(
            *(ChannelPlace(name=f"state/{name}", variable=at, unit="deg/s") for name, at in rates.items()),
            *(ChannelPlace(name=name, variable=at, unit="deg") for name, at in others.items()),
        ),
    )

    def read(path: Path) -> Any:
        record = read_log(path, column_map)
        return record.time, record.channels

    out = []
    for version in ("v7", "v7.3"):
        path = makers.write(folder / f"objects{version}.mat", version, compress=False, **held)
        out.append(Subject(f"MAT {version[1:]}, objects", ".mat", path.read_bytes(), read, share=0.1))
    return out


def _logs(folder: Path) -> list[Subject]:
    from scipy.io import savemat

    from freqid.flightlog.column_map import ChannelPlace, ColumnMap, TimePlace
    from freqid.flightlog.read import read_log

    makers = _makers("autopilot_logs")
    time_s = np.arange(100) / 50
    columns = np.column_stack([time_s, np.sin(time_s), np.cos(time_s)])
    by_name = ColumnMap(
        time=TimePlace(column="t", unit="s"),
        channel=(
            ChannelPlace(name="state/q", column="q", unit="deg/s"),
            ChannelPlace(name="effector/x", column="x", unit="deg"),
        ),
    )
    by_number = ColumnMap(
        time=TimePlace(column=1, unit="s"),
        channel=(ChannelPlace(name="state/q", column=2, unit="deg/s"),),
    )
    ulog_map = ColumnMap(
        channel=(ChannelPlace(name="state/q", column="rates.q", unit="rad/s"),),
    )
    dataflash_map = ColumnMap(
        channel=(ChannelPlace(name="state/q", column="IMU.GyrY", unit="rad/s"),),
    )
    lines = [", ".join(map(repr, row)) + "\n" for row in columns.tolist()]
    (folder / "a.csv").write_text("t, q, x\n" + "".join(lines))
    savemat(folder / "5.mat", {"data": columns}, do_compression=False)
    savemat(folder / "7.mat", {"data": columns}, do_compression=True)
    with h5py.File(folder / "73.mat", "w", userblock_size=512) as file:
        file.create_dataset("data", data=columns.T)
    sidpac = np.zeros((100, 90))
    sidpac[:, 0] = time_s
    sidpac[:, 1:40] = np.sin(time_s[:, None] + np.arange(39))
    savemat(folder / "s.mat", {"fdata": sidpac})
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(dict(zip("tqx", columns.T, strict=True))), folder / "a.parquet")
    fast = 5 + np.arange(200) / 100
    q32 = np.sin(fast).astype(np.float32)
    ulog = makers.ulog_bytes(
        [("rates", 0, fast, {"q": q32, "p": q32})],
        info=(("ver_sw", "abc"),),
        parameters=(("MC_ROLL_P", 6.5),),
    )
    us = [round(1e6 * t) for t in fast.tolist()]
    imu = [(n, float(x), float(x)) for n, x in zip(us, q32, strict=True)]
    flash = makers.dataflash_bytes(
        [
            ("PARM", "QNf", "TimeUS,Name,Value", [(us[0], "SYSID_THISMAV", 1.0)]),
            ("IMU", "Qff", "TimeUS,GyrX,GyrY", imu),
        ]
    )

    def by(column_map: ColumnMap) -> Callable[[Path], Any]:
        def read(path: Path) -> Any:
            record = read_log(path, column_map)
            return record.time, record.channels

        return read

    def sidpac_read(path: Path) -> Any:
        record = read_log(path)
        return record.time, record.channels

    return [
        Subject("csv", ".csv", (folder / "a.csv").read_bytes(), by(by_name), text=True),
        Subject("MAT 5", ".mat", (folder / "5.mat").read_bytes(), by(by_number)),
        Subject("MAT 7, compressed", ".mat", (folder / "7.mat").read_bytes(), by(by_number)),
        Subject("MAT 7.3", ".mat", (folder / "73.mat").read_bytes(), by(by_number), share=0.2),
        *_simulink(folder),
        Subject("SIDPAC", ".mat", (folder / "s.mat").read_bytes(), sidpac_read),
        Subject("Parquet", ".parquet", (folder / "a.parquet").read_bytes(), by(by_name)),
        Subject("ULog", ".ulg", ulog, by(ulog_map)),
        Subject("DataFlash", ".bin", flash, by(dataflash_map)),
    ]


def _tables(folder: Path) -> list[Subject]:
    from freqid.compare.read_law import law_of
    from freqid.flightlog.column_map import read_column_map
    from freqid.simulate.effects.files import load_file
    from freqid.workflows.scenarios.check_scenario import check_scenario

    linear = PROJECT / "scenarios" / "linear.toml"
    vehicle = fq.read_scenario(linear).aircraft()
    loop = b"""name = "hold"
sign = 1

[signals]
q = "deg/s"
theta = "deg"

[commands]
de = "deg"

[gains.de]
q = 0.4
theta = 1.0

[actuator.de]
frequency_hz = 8.0
damping = 0.8
delay_s = 0.02
"""

    def checked(path: Path) -> Any:
        scenario = fq.read_scenario(path)
        return scenario, check_scenario(scenario)

    def law(path: Path) -> Any:
        at, name = law_of(path, vehicle)
        return at(20.0, 1.2, {}), name

    scenarios = [PROJECT / "scenarios" / f"{name}.toml" for name in ("la8", "linear", "tiltrotor")]
    out = [
        Subject(
            f"scenario {path.stem}, read and checked",
            ".toml",
            path.read_bytes(),
            checked,
            text=True,
            share=1 / 3,
        )
        for path in scenarios
    ]
    maps = (PROJECT / "scenarios" / "maps" / "linear.toml").read_bytes()
    out.append(Subject("column map", ".toml", maps, read_column_map, text=True))
    out.append(Subject("loop", ".toml", loop, law, text=True))
    effects = (PROJECT / "examples" / "gyro_effect.py").read_bytes()
    out.append(Subject("effects", ".py", effects, lambda path: sorted(load_file(path)), text=True))
    return out


def judge(subject: Subject, cases: int, folder: Path) -> tuple[list[Any], list[tuple[int, str, str]], float]:
    """Return the row of a reader in the table, what became of all its cases, and how long it took, s."""
    start = time.time()
    folder.mkdir()
    results = run(subject, cases, folder)
    count = Counter(became for _, became, _ in results)
    return [subject.name, cases, *(count[o] for o in OUTCOMES)], results, time.time() - start


_chosen: list[Subject] = []  # of the processes that are forked: what reads cannot be sent to them


def _judge_chosen(task: tuple[int, int, Path]) -> Any:
    index, cases, folder = task
    return judge(_chosen[index], cases, folder)


def main() -> None:
    """Run the cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--only", default="")
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--case", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_suffix(".csv"))
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _chosen[:] = [s for s in subjects(folder) if re.search(asked.only, s.name)]
        if asked.case is not None:
            path = folder / f"case{_chosen[0].suffix}"
            path.write_bytes(case_of(_chosen[0], asked.case))
            print(_chosen[0].read(path))
            return
        tasks = [(i, max(1, round(asked.cases * s.share)), folder / f"run{i}") for i, s in enumerate(_chosen)]
        rows: dict[str, list[Any]] = {}
        with multiprocessing.get_context("fork").Pool(asked.jobs, maxtasksperchild=1) as pool:
            for row, results, seconds in pool.imap_unordered(_judge_chosen, tasks):
                rows[row[0]] = row
                print(*row[:2], dict(zip(OUTCOMES, row[2:], strict=True)), f"{seconds:.0f} s", flush=True)
                for number, became, said in results:
                    if asked.show and became in FAULTS:
                        print("   ", number, became, said[:240], flush=True)
                inside = [rows[s.name] for s in _chosen if s.name in rows]
                with asked.csv.open("w", newline="") as file:
                    csv.writer(file).writerows([["reader", "cases", *OUTCOMES], *inside])


if __name__ == "__main__":
    main()
