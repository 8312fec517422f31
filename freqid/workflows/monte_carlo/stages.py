"""What is done with one case: flown, identified, blended or diagnosed, or a function of one's own.

A stage returns rows, or columns of them. The columns that a page understands: ``quantity`` with ``estimate``,
``std_error``, ``lo``, ``hi`` and ``reference``, or ``covered``; ``present`` and ``called`` of a gap,
``right`` of a name; ``value``. All other columns are kept as they are.
"""

from __future__ import annotations

import hashlib
import inspect
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from freqid.core.errors import FreqidError, UsageError, nearest
from freqid.core.record import FlightRecord
from freqid.core.results.design import MultisineDesign
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario, read_scenario
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.workflows.monte_carlo.plan import Setting, nested
from freqid.workflows.monte_carlo.rows import Columns, write_rows

if TYPE_CHECKING:
    from freqid.workflows.fly import SimulatedManeuver

Designs = Mapping[str, MultisineDesign]
_COMMON = ("at", "noise", "sensors", "turbulence", "duration", "feedback", "effects", "tolerance")
KEYS = {
    "fly": _COMMON,
    "identify": (*_COMMON, "estimator", "align", "kinematics"),
    "blend": (*_COMMON, "estimator", "held_out"),
    "diagnose": (*_COMMON, "level", "draws"),
}
"""Settings that each stage knows; those of `effects` and `tolerance` are tables."""
_DRAWN = 7  # beside the seed: of what is drawn within tolerances
_APART = 1000  # seeds of the flights of one case, each of which has sensors' errors of its own


@dataclass(frozen=True)
class Sources:
    """Files that cases need, by their contents: a worker elsewhere has freqid and nothing more.

    Attributes
    ----------
    scenario : str
        Name or path, for what is said.
    scenario_text : bytes
        Empty where there is none.
    function : str
        ``FILE.py:NAME``; empty for a stage of freqid.
    function_text : bytes
    designs : mapping
        Inputs by condition; under the empty name those that conditions share.
    """

    scenario: str = ""
    scenario_text: bytes = b""
    function: str = ""
    function_text: bytes = b""
    designs: Designs | None = None


def cases(path: Path, *, stage: str, setting: Setting, seeds: Sequence[int], sources: Sources) -> None:
    """Do the cases of one setting, one a seed, and write their rows: a unit of work.

    A case that cannot be done, such as a flight that diverges, is a row that says why.
    """
    scenario = _scenario(sources.scenario, sources.scenario_text) if sources.scenario_text else None
    work = _own(sources) if sources.function else None
    tables: list[tuple[int, Columns]] = []
    for seed in seeds:
        arguments = nested(setting)
        case = Case(scenario, sources.designs or {}, seed, arguments) if scenario and not work else None
        try:
            if work is not None:
                found = work(seed, **({"scenario": scenario} if _wants_scenario(work) else {}), **arguments)
            else:
                assert case is not None  # the plan was checked
                found = STAGES[stage](case)
        except UsageError:
            raise  # every case of the setting would say the same
        except FreqidError as error:
            found = case.row(failure=str(error)) if case else {"failure": str(error)}
        tables.append((seed, _columns(found)))
    write_rows(path, setting, tables)


def _columns(found: Any) -> Columns:
    """Return what a stage gives as columns: a mapping of them, or rows."""
    if isinstance(found, Mapping):
        return found
    if isinstance(found, Sequence) and found and all(isinstance(row, Mapping) for row in found):
        names = list(dict.fromkeys(name for row in found for name in row))
        return {name: [row.get(name) for row in found] for name in names}
    raise UsageError(
        f"the stage returns {type(found).__name__}, expected a row, rows or columns",
        remedy="return a dictionary, or a list of them",
    )


@dataclass(frozen=True)
class Case:
    """One case of a stage of freqid: a scenario as it is flown, with what is drawn for it."""

    scenario: Scenario
    designs: Designs
    seed: int
    setting: Setting

    def get(self, name: str, default: Any = None) -> Any:
        """Return a setting."""
        return self.setting.get(name, default)

    @property
    def present(self) -> bool:
        """Whether an effect is inserted."""
        return any(v for e in self.effects.values() for v in (e.values() if isinstance(e, dict) else [e]))

    @property
    def effects(self) -> dict[str, Any]:
        """Effects that are inserted, by id; those of size zero are left out."""
        found = {}
        for name, value in (self.get("effects") or {}).items():
            kept = {k: v for k, v in value.items() if v} if isinstance(value, dict) else value
            if kept:
                found[name] = kept
        return found

    @property
    def drawn(self) -> dict[str, float]:
        """What is drawn for this case within each tolerance, in its unit."""
        sigmas = _dotted(self.get("tolerance") or {})
        rng = np.random.default_rng([self.seed, _DRAWN])
        normal = rng.standard_normal(len(sigmas))
        return {n: float(s * x) for (n, s), x in zip(sorted(sigmas.items()), normal, strict=True)}

    @property
    def flown(self) -> Scenario:
        """The scenario with its effects and with what is drawn within tolerances."""
        from freqid.simulate.effects import find
        from freqid.simulate.maneuver import with_effects

        settings: dict[str, dict[str, float]] = {}
        for name, value in self.effects.items():
            settings[name] = dict(value) if isinstance(value, dict) else {find(name).size: float(value)}
        for name, value in self.drawn.items():
            effect, _, parameter = name.partition(".")
            mine = settings.setdefault(effect, {})
            parameter = parameter or find(effect).size
            mine[parameter] = mine.get(parameter, 0.0) + value
        return with_effects(self.scenario, settings) if settings else self.scenario

    def fly(self, at: str, flight: int = 0) -> SimulatedManeuver:
        """Fly a condition; `flight` is the number among those of the case."""
        from freqid.workflows.fly import simulate

        described = self.flown
        turbulence = float(self.get("turbulence", 0.0))
        same = described is self.scenario and not turbulence
        flown = simulate(
            described,
            self.designs.get(at, self.designs.get("")),
            at=at,
            duration=self.get("duration"),
            sensors=self.get("sensors", "research"),
            noise=float(self.get("noise", 1.0)),
            turbulence=turbulence,
            feedback=self.get("feedback", True),
            seed=self.seed + _APART * flight,
            loop=_loop(described.sha256, described, at) if same else None,
        )
        flown.refuse_divergence(at)
        return flown

    def without_errors(self, flown: SimulatedManeuver, flight: int = 0) -> FlightRecord:
        """Return what sensors without errors log of the same flight."""
        from freqid.simulate.maneuver import Conditions, flyable, logged

        conditions = Conditions(
            self.get("sensors", "research"),
            0.0,
            turbulence=float(self.get("turbulence", 0.0)),
            seed=self.seed + _APART * flight,
        )
        scenario, wind = flyable(flown.scenario, conditions)
        at = flown.truth.reference
        design = self.designs.get(at, self.designs.get(""))
        names = design.names if design else ()
        return logged(scenario, flown.flown.flight, names, at, conditions, wind).record

    def row(self, **columns: Any) -> dict[str, Any]:
        """Return a row that says what was drawn, beside its own columns."""
        return {**columns, **{f"drawn.{n}": v for n, v in self.drawn.items()}}


def fly(case: Case) -> list[dict[str, Any]]:
    """Fly; a row for each state with its largest excursion from the start."""
    flown = case.fly(case.get("at"))
    return [
        case.row(quantity=name, value=found["largest"], unit=found["unit"], inside=found.get("inside"))
        for name, found in flown.excursions.items()
    ]


def identify(case: Case) -> list[dict[str, Any]]:
    """Fly and identify; a row for each parameter, beside what sensors without errors give of that flight.

    The reference is by the scenario's own estimator whatever that of the case: on a vehicle that is not
    linear, two estimators differ by more than noise.
    """
    from freqid.workflows.models.identify import identify_point

    at = case.get("at")
    chosen = {n: case.setting[n] for n in ("estimator", "align", "kinematics") if n in case.setting}
    flown = case.fly(at)
    model = identify_point(flown.record, case.scenario, at=at, **chosen)
    perfect = identify_point(case.without_errors(flown), case.scenario, at=at)
    return _parameters(case, model, perfect)


def _parameters(case: Case, model: PointModel, perfect: PointModel) -> list[dict[str, Any]]:
    rows = []
    for response, found in model.responses.items():
        for i, regressor in enumerate(found.regressors):
            if regressor in perfect[response].regressors:
                rows.append(
                    case.row(
                        quantity=f"{response}.{regressor}",
                        estimate=float(found.estimate[i]),
                        std_error=float(found.std_error[i]),
                        lo=float(found.lower[i]),
                        hi=float(found.upper[i]),
                        reference=float(perfect[response][regressor][0]),
                        r2=float(found.r2),
                    )
                )
    return rows


def blend(case: Case) -> list[dict[str, Any]]:
    """Fly and identify conditions and blend them; a row for each parameter at a held-out condition."""
    from freqid.workflows.models.blend import blend as blended
    from freqid.workflows.models.identify import identify_point

    ids, held = [i for i in case.get("at") if i != case.get("held_out")], case.get("held_out")
    estimator = case.get("estimator")
    points = [
        identify_point(case.fly(at, k).record, case.scenario, at=at, estimator=estimator)
        for k, at in enumerate(ids)
    ]
    model = blended(points)
    flight = case.without_errors(case.fly(held, len(ids)), len(ids))
    perfect = identify_point(flight, case.scenario, at=held)
    reference = case.scenario.reference_of(held)
    along = model.reference(reference.u, reference.rho)
    along["u"] = np.full_like(along["u"], reference.u)  # not the mean speed that was flown nearby
    rows = []
    for response in model.names:
        found = model.parameters(response, along)
        for name, estimate, error in zip(found.names, found.estimate, found.std_error, strict=True):
            if name in perfect[response].regressors:
                e, s = float(np.squeeze(estimate)), float(np.squeeze(error))
                low, high = map(float, confidence_interval(e, s))
                truth = float(perfect[response][name][0])
                rows.append(
                    case.row(
                        quantity=f"{response}.{name}",
                        estimate=e,
                        std_error=s,
                        lo=low,
                        hi=high,
                        reference=truth,
                    )
                )
    return rows


def diagnose(case: Case) -> list[dict[str, Any]]:
    """Fly, and diagnose against the simulation without effects: whether a gap is called, and its name."""
    from freqid.workflows.diagnose import diagnose_gap

    at = case.get("at")
    simulation = _simulation(case.scenario.sha256, case.scenario)
    conditions = [at] if isinstance(at, str) else list(at)
    flights = [case.fly(one, k).record for k, one in enumerate(conditions)]
    gap = diagnose_gap(
        simulation,
        flights,
        scenario=case.scenario,
        tolerances=_dotted(case.get("tolerance") or {}),
        level=case.get("level", 0.02),
        draws=case.get("draws", 500),
        seed=case.seed,
        plan=False,
        anyway=True,
    )
    which, present = gap.which, case.present
    named = sorted(which.named)
    right = bool({*named} & {*case.effects}) if named and present else None
    return [
        case.row(
            present=present,
            # numpy's where the level is
            called=bool(gap.gap.exists),  # pyrefly: ignore[unnecessary-type-conversion]
            named=" or ".join(named) or None,
            right=right,
            p=float(gap.gap.p),
            in_set=bool({*which.set} & {*case.effects}) if present else None,
        )
    ]


STAGES: dict[str, Callable[[Case], list[dict[str, Any]]]] = {
    "fly": fly,
    "identify": identify,
    "blend": blend,
    "diagnose": diagnose,
}


def _dotted(table: Mapping[str, Any]) -> dict[str, float]:
    from freqid.workflows.monte_carlo.plan import flat

    return {name: float(value) for name, value in flat(table).items()}


@lru_cache(maxsize=4)
def _scenario(name: str, text: bytes) -> Scenario:
    """Return the scenario of a text, with the name that results call it by."""
    with tempfile.TemporaryDirectory(prefix="freqid-") as folder:
        path = Path(folder) / "scenario.toml"
        path.write_bytes(text)
        return msgspec.structs.replace(read_scenario(path)[0], file=name)


_loops: dict[tuple[str, str], Any] = {}
_simulations: dict[str, Any] = {}


def _loop(sha256: str, scenario: Scenario, at: str) -> Any:
    """Return trims and law of a corridor, which cases of the conditions along it share."""
    from freqid.simulate.control.lq import close_loop, corridor

    reference = scenario.reference_of(at)
    key = (sha256, " ".join(one.id for one in corridor(scenario, reference)))
    if key not in _loops:
        _loops[key] = close_loop(scenario, reference)
    return _loops[key]


def _simulation(sha256: str, scenario: Scenario) -> Any:
    """Return the simulation of a scenario, which keeps what it has compiled."""
    from freqid.workflows.connect import connect

    if sha256 not in _simulations:
        _simulations[sha256] = connect(scenario=scenario)
    return _simulations[sha256]


def load_function(path: Path, name: str, text: bytes) -> Callable[..., Any]:
    """Return a function of a Python file, which is run.

    Raises
    ------
    UsageError
        Where running it raises, or it has no such function.
    """
    where = str(path)
    module = ModuleType(f"stage of {path.name}")
    module.__file__ = where
    try:
        exec(compile(text, where, "exec"), module.__dict__)
    except Exception as error:
        raise UsageError(
            f"running the file raises {type(error).__name__}: {error}", where=where, remedy="correct it"
        ) from error
    found = getattr(module, name, None)
    if not callable(found):
        known = [n for n, v in vars(module).items() if inspect.isfunction(v)]
        raise UsageError(f"has no function '{name}'", where=where, remedy=nearest(name, known))
    return found


_functions: dict[str, Callable[..., Any]] = {}


def _own(sources: Sources) -> Callable[..., Any]:
    """Return the function of one's own, from the text of its file: a worker need not have the file."""
    file, _, name = sources.function.rpartition(":")
    key = f"{name} {hashlib.sha256(sources.function_text).hexdigest()}"
    if key not in _functions:
        _functions[key] = load_function(Path(file), name, sources.function_text)
    return _functions[key]


def _wants_scenario(work: Callable[..., Any]) -> bool:
    return "scenario" in inspect.signature(work).parameters
