# The public names and their modules: type checkers read them here, and so does `tfarm/__init__.py`.
from tfarm import plots as plots
from tfarm.arm import Arm as Arm
from tfarm.arm import Attachment as Attachment
from tfarm.arm import Gauge as Gauge
from tfarm.arm import Hub as Hub
from tfarm.arm import HubFeedback as HubFeedback
from tfarm.arm import Law as Law
from tfarm.arm import Link as Link
from tfarm.arm import Motor as Motor
from tfarm.arm import Payload as Payload
from tfarm.arm import RotarySpring as RotarySpring
from tfarm.arm import Section as Section
from tfarm.arm import load as load
from tfarm.arm import presets as presets
from tfarm.assessment import compare as compare
from tfarm.assessment import loop_function as loop_function
from tfarm.assessment import result_card as result_card
from tfarm.assessment.step import step as step
from tfarm.dsp.results import simulate as simulate
from tfarm.errors import CertificationError as CertificationError
from tfarm.errors import ConvergenceError as ConvergenceError
from tfarm.errors import ParameterError as ParameterError
from tfarm.exact.outputs import Output as Output
from tfarm.exported import export as export
from tfarm.face import CaseFace
from tfarm.fitting.data import Measured as Measured
from tfarm.fitting.data import read_measured as read_measured
from tfarm.fitting.experiment import experiment as experiment
from tfarm.fitting.fit import fit as fit
from tfarm.fitting.overlay import overlay as overlay
from tfarm.fitting.prediction import predict as predict
from tfarm.fitting.recording import read_recording as read_recording
from tfarm.fitting.run_files import runs_of as runs_of
from tfarm.fitting.runs import RigRun as RigRun
from tfarm.fitting.together import fit_together as fit_together
from tfarm.loop.locus import locus as locus
from tfarm.loop.margins import margins as margins
from tfarm.loop.norms import norm as norm
from tfarm.loop.nyquist import nyquist as nyquist
from tfarm.loop.plane import gain_map
from tfarm.loop.poles import closed_loop_poles as closed_loop_poles
from tfarm.loop.sampled_analysis import sampled as sampled
from tfarm.loop.spillover import spill as spill
from tfarm.reduced import reduce as reduce
from tfarm.references import reference as reference
from tfarm.report.live import explore as explore
from tfarm.response import bode as bode
from tfarm.response import transfer as transfer
from tfarm.spectrum import damped_modes as damped_modes
from tfarm.spectrum import modes as modes
from tfarm.spectrum.gains import default_gains as default_gains
from tfarm.studies.study import study as study
from tfarm.synthesis.design import design as design
from tfarm.synthesis.design import trade_off as trade_off
from tfarm.tuner import tune as tune

Case = CaseFace
map = gain_map

__version__: str
__all__: list[str]
