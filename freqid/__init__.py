"""Frequency-domain system identification of eVTOL aircraft from flight data.

``import freqid as fq`` gives the verbs and nouns of ``__all__``. Each is loaded when it is first used, so the
import itself takes milliseconds and loads neither jax nor matplotlib. Type checkers read ``__init__.pyi``.

Examples
--------
>>> import freqid as fq
>>> scenario = fq.read_scenario("la8")
>>> scenario
<Scenario 'LA-8 class, notional': 28.6 kg, 20 effectors, 8 rotors, 32 reference conditions, from la8>
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

__version__ = "0.1.0"

_VERBS = {
    "read_scenario": "workflows.files",
    "new_scenario": "workflows.scenarios.new_scenario",
    "check_scenario": "workflows.scenarios.check_scenario",
    "read": "workflows.files",
    "save": "workflows.files",
    "page": "views.page",
    "review": "workflows.reviews.review",
    "design_inputs": "workflows.design",
    "simulate": "workflows.fly",
    "simulate_campaign": "workflows.fly_trim_sequence",
    "read_log": "workflows.import_log",
    "read_pieces": "workflows.import_log",
    "list_log": "workflows.import_log",
    "align_excitation": "workflows.import_log",
    "split_flight": "workflows.import_log",
    "quicklook": "workflows.quicklook",
    "check_sensors": "workflows.models.sensors",
    "correct_sensors": "workflows.models.sensors",
    "align_sensors": "workflows.models.sensors",
    "identify_point": "workflows.models.identify",
    "identify_output_error": "workflows.models.output_error",
    "predict": "workflows.models.blend",
    "predict_flight": "workflows.models.seal",
    "score_prediction": "workflows.models.seal",
    "frequency_response": "workflows.models.frequency_response",
    "blend": "workflows.models.blend",
    "blend_by_advance_ratio": "workflows.models.advance_ratio",
    "export": "workflows.export",
    "margins": "workflows.models.margins",
    "connect": "workflows.connect",
    "check_simulation": "workflows.connect",
    "diagnose_gap": "workflows.diagnose",
    "next_test": "workflows.diagnose",
    "fly_sealed": "workflows.reviews.sealed_trial",
    "open_seal": "workflows.reviews.sealed_trial",
    "compare_simulations": "workflows.compare",
    "study": "workflows.studies.study",
    "monte_carlo": "workflows.monte_carlo.run",
}
_NOUNS = {
    "Scenario": "core.scenario",
    "Vehicle": "core.vehicle",
    "FlightRecord": "core.record",
    "Maneuver": "core.record",
    "MultisineDesign": "core.results.design",
    "PointModel": "core.results.point",
    "DynamicModel": "identify.output_error.model",
    "OutputErrorModel": "core.results.output_error",
    "FrequencyResponse": "core.results.frequency_response",
    "Prediction": "core.results.prediction",
    "Score": "core.results.prediction",
    "GlobalModel": "blend.global_model",
    "AdvanceRatioModel": "core.results.advance_ratio",
    "LoopMargins": "core.results.loop_margins",
    "GapDiagnosis": "core.results.diagnosis",
    "Rivals": "core.results.rivals",
    "TrialOutcome": "core.results.judged.sealed_trial",
    "Review": "core.results.judged.review",
    "StudyResults": "blend.corridor_study",
    "MonteCarlo": "core.results.judged.monte_carlo",
    "FreqidError": "core.errors",
}
_FOLDERS = ("blend", "simulate")  # that are verbs too

# The names are loaded when they are asked for.
__all__ = [*_VERBS, *_NOUNS]  # pyrefly: ignore[unresolvable-dunder-all]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'freqid' has no attribute '{name}'")
    if name in _FOLDERS:
        return import_module(f"freqid.{name}")
    found = getattr(import_module(f"freqid.{(_VERBS | _NOUNS)[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)


class _Verb(ModuleType):
    """A folder with the name of a verb, ``blend`` and ``simulate``: called, it does what the verb says."""

    def __call__(self, *args: object, **kwargs: object) -> object:
        return self.__wrapped__(*args, **kwargs)

    @property
    def __wrapped__(self):
        name = self.__name__.rpartition(".")[2]
        return getattr(import_module(f"freqid.{_VERBS[name]}"), name)


class _Package(ModuleType):
    """The package, which makes such folders callable as they are imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _FOLDERS and isinstance(value, ModuleType):
            value.__class__ = _Verb
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
