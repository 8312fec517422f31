"""The public names: which they are, when they load, that they are documented, and that examples run."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import freqid as fq

PACKAGE = Path(fq.__file__).parent
VERBS = [
    "read_scenario",
    "new_scenario",
    "check_scenario",
    "read",
    "save",
    "page",
    "review",
    "design_inputs",
    "simulate",
    "simulate_campaign",
    "read_log",
    "read_pieces",
    "list_log",
    "align_excitation",
    "split_flight",
    "quicklook",
    "check_sensors",
    "correct_sensors",
    "align_sensors",
    "identify_point",
    "identify_output_error",
    "predict",
    "predict_flight",
    "score_prediction",
    "frequency_response",
    "blend",
    "blend_by_advance_ratio",
    "export",
    "margins",
    "connect",
    "check_simulation",
    "diagnose_gap",
    "next_test",
    "fly_sealed",
    "open_seal",
    "compare_simulations",
    "study",
    "monte_carlo",
]
NOUNS = [
    "Scenario",
    "Vehicle",
    "FlightRecord",
    "Maneuver",
    "MultisineDesign",
    "PointModel",
    "DynamicModel",
    "OutputErrorModel",
    "FrequencyResponse",
    "Prediction",
    "Score",
    "GlobalModel",
    "AdvanceRatioModel",
    "LoopMargins",
    "GapDiagnosis",
    "Rivals",
    "TrialOutcome",
    "Review",
    "StudyResults",
    "MonteCarlo",
    "FreqidError",
]
JOBS = ["workflows.design", "workflows.fly", "blend.global_model"]  # whose results have methods of their own


def test_a_public_name_comes_or_goes_only_on_purpose():
    assert fq.__all__ == [*VERBS, *NOUNS]
    assert set(dir(fq)) == set(fq.__all__)
    with pytest.raises(AttributeError, match="no attribute 'identify_points'"):
        fq.identify_points


def test_type_checkers_see_the_same_names():
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    for node in stub.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                found = getattr(importlib.import_module(node.module), alias.name)
                assert inspect.unwrap(getattr(fq, alias.name)) is inspect.unwrap(found)
    named = {a.asname for node in stub.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert named == set(fq.__all__)


@pytest.mark.parametrize(
    ("words", "absent"),
    [
        ("", {"jax", "matplotlib", "numpy", "pandas", "h5py"}),
        ("fq.read_scenario('la8')", {"jax", "matplotlib", "pandas"}),
        ("fq.identify_point", {"jax", "matplotlib", "pandas"}),
        ("fq.DynamicModel", {"jax", "matplotlib", "pandas"}),
        ("import freqid.blend.global_model; assert callable(fq.blend)", {"jax", "matplotlib"}),
    ],
)
def test_nothing_is_loaded_before_it_is_used(words, absent):
    code = f"import sys, freqid as fq\n{words}\nsys.exit(str({absent!r} & set(sys.modules) or ''))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1)
    assert done.stderr.strip() == ""


def test_a_folder_with_the_name_of_a_verb_is_both():
    import freqid.simulate.effects as effects

    assert fq.simulate.effects is effects
    assert "scenario" in inspect.signature(fq.simulate).parameters
    assert "points" in inspect.signature(fq.blend).parameters


def _public_callables():
    for name in fq.__all__:
        found = getattr(fq, name)
        found = getattr(found, "__wrapped__", found)
        if not inspect.isclass(found):
            yield name, found
    for name in (*NOUNS, *JOBS):
        module = importlib.import_module(f"freqid.{name}") if "." in name else None
        kinds = [getattr(fq, name)] if module is None else vars(module).values()
        for kind in kinds:
            if not inspect.isclass(kind) or (module and kind.__module__ != module.__name__):
                continue
            for method, found in inspect.getmembers(kind, inspect.isroutine):
                own = getattr(found, "__qualname__", "").startswith(f"{kind.__name__}.")
                if own and not method.startswith("_"):
                    yield f"{kind.__name__}.{method}", found


CALLABLES = dict(_public_callables())


@pytest.mark.parametrize("name", CALLABLES)
def test_every_argument_is_documented(name):
    found = CALLABLES[name]
    text = inspect.getdoc(found)
    assert text, "there is no docstring"
    arguments = [p for p in inspect.signature(found).parameters if p not in ("self", "cls")]
    listed = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.M | re.S)
    if listed is None:  # a method of one line says its arguments in it
        assert "." in name
        assert all(a in ("path", "where") or f"`{a}`" in text for a in arguments), arguments
        return
    head = " ".join(re.findall(r"^(\S.*?)(?: : .*)?$", listed[1], re.M))
    missing = [a for a in arguments if not re.search(rf"\b{a}\b", head)]
    assert not missing


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_says_what_it_returns_raises_and_how_it_is_used(name):
    text = inspect.getdoc(CALLABLES[name])
    for section in ("Returns", "Raises", "Examples"):
        assert re.search(rf"^{section}\n-+$", text, re.M), section


@pytest.mark.parametrize("job", sorted({CALLABLES[name].__module__ for name in VERBS} | {"freqid"}))
def test_the_examples_run(job, linear, monkeypatch):
    monkeypatch.chdir(linear["folder"])
    module = importlib.import_module(job)
    names = {**vars(module), **{k: v for k, v in linear.items() if k != "folder"}}
    for test in doctest.DocTestFinder().find(module, globs=names):
        if job != "freqid" or test.name == "freqid":
            assert doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test).failed == 0
