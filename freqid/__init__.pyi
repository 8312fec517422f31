"""The public names, for type checkers and editors; the same as ``__all__``."""

from freqid.blend.campaign import StudyResults as StudyResults
from freqid.blend.global_model import GlobalModel as GlobalModel
from freqid.core.errors import FreqidError as FreqidError
from freqid.core.record import FlightRecord as FlightRecord
from freqid.core.record import Maneuver as Maneuver
from freqid.core.results.advance_ratio import AdvanceRatioModel as AdvanceRatioModel
from freqid.core.results.design import MultisineDesign as MultisineDesign
from freqid.core.results.diagnosis import GapDiagnosis as GapDiagnosis
from freqid.core.results.frequency_response import FrequencyResponse as FrequencyResponse
from freqid.core.results.output_error import OutputErrorModel as OutputErrorModel
from freqid.core.results.point import PointModel as PointModel
from freqid.core.results.rivals import Rivals as Rivals
from freqid.core.scenario import Scenario as Scenario
from freqid.core.vehicle import Vehicle as Vehicle
from freqid.identify.output_error.model import DynamicModel as DynamicModel
from freqid.views.page import page as page
from freqid.workflows.advance_ratio import blend_by_advance_ratio as blend_by_advance_ratio
from freqid.workflows.blend import blend as blend
from freqid.workflows.blend import predict as predict
from freqid.workflows.campaign import simulate_campaign as simulate_campaign
from freqid.workflows.compare import compare_simulations as compare_simulations
from freqid.workflows.connect import check_simulation as check_simulation
from freqid.workflows.connect import connect as connect
from freqid.workflows.design import design_inputs as design_inputs
from freqid.workflows.diagnose import diagnose_gap as diagnose_gap
from freqid.workflows.diagnose import next_test as next_test
from freqid.workflows.files import read as read
from freqid.workflows.files import read_scenario as read_scenario
from freqid.workflows.files import save as save
from freqid.workflows.fly import simulate as simulate
from freqid.workflows.frequency_response import frequency_response as frequency_response
from freqid.workflows.identify import identify_point as identify_point
from freqid.workflows.import_log import align_excitation as align_excitation
from freqid.workflows.import_log import export_log as export_log
from freqid.workflows.import_log import list_log as list_log
from freqid.workflows.import_log import read_log as read_log
from freqid.workflows.import_log import read_pieces as read_pieces
from freqid.workflows.import_log import split_flight as split_flight
from freqid.workflows.output_error import identify_output_error as identify_output_error
from freqid.workflows.sensors import align_sensors as align_sensors
from freqid.workflows.sensors import check_sensors as check_sensors
from freqid.workflows.sensors import correct_sensors as correct_sensors
from freqid.workflows.study import study as study

__version__: str
