"""tfarm: a rotating flexible Timoshenko arm in the frequency domain, from its exact solution::

    arm = tfarm.load("sasaki2012")            # a preset or a TOML file
    G = tfarm.transfer(arm, "root_moment")    # exact; callable at any complex s
    modes = tfarm.modes(arm, count=10)        # complete
    law = tfarm.HubFeedback(K1=0.3, K2=0.3)   # u = -K1 theta_t - K2 E I phi'(0)
    found = tfarm.margins(arm, law)           # verdict and stability margins
    tfarm.plots.modes(modes)                  # pictures of records: modes, bode, nyquist, ...

Each name below is imported at its first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tfarm import plots
    from tfarm.arm import (
        Arm,
        Attachment,
        Gauge,
        Hub,
        HubFeedback,
        Law,
        Link,
        Motor,
        Payload,
        RotarySpring,
        Section,
        load,
        presets,
    )
    from tfarm.assessment import compare, loop_function, result_card
    from tfarm.assessment.step import step
    from tfarm.dsp.results import simulate
    from tfarm.errors import CertificationError, ConvergenceError, ParameterError
    from tfarm.exact.outputs import Output
    from tfarm.exported import export
    from tfarm.face import CaseFace as Case
    from tfarm.fitting.data import Measured, read_measured
    from tfarm.fitting.fit import fit
    from tfarm.fitting.overlay import overlay
    from tfarm.loop.locus import locus
    from tfarm.loop.margins import margins
    from tfarm.loop.nyquist import nyquist
    from tfarm.loop.plane import gain_map as map
    from tfarm.loop.poles import closed_loop_poles
    from tfarm.loop.sampled_verdict import sampled
    from tfarm.loop.stability import spill
    from tfarm.reduced import reduce
    from tfarm.report.live import explore
    from tfarm.response import bode, transfer
    from tfarm.spectrum import damped_modes, modes
    from tfarm.spectrum.table import default_gains
    from tfarm.studies.study import study
    from tfarm.synthesis.design import design
    from tfarm.tuner import tune

__version__ = "1.0.0"

__all__ = [
    "Arm",
    "Attachment",
    "Case",
    "CertificationError",
    "ConvergenceError",
    "Gauge",
    "Hub",
    "HubFeedback",
    "Law",
    "Link",
    "Measured",
    "Motor",
    "Output",
    "ParameterError",
    "Payload",
    "RotarySpring",
    "Section",
    "bode",
    "closed_loop_poles",
    "compare",
    "damped_modes",
    "default_gains",
    "design",
    "explore",
    "export",
    "fit",
    "load",
    "locus",
    "loop_function",
    "map",
    "margins",
    "modes",
    "nyquist",
    "overlay",
    "plots",
    "presets",
    "read_measured",
    "reduce",
    "result_card",
    "sampled",
    "simulate",
    "spill",
    "step",
    "study",
    "transfer",
    "tune",
]

_ROOMS = {  # the module of a name; after a colon another name there
    "Case": "face:CaseFace",
    "bode": "response",
    "design": "synthesis.design",
    "locus": "loop.locus",
    "nyquist": "loop.nyquist",
    "closed_loop_poles": "loop.poles",
    "compare": "assessment",
    "damped_modes": "spectrum",
    "default_gains": "spectrum.table",
    "loop_function": "assessment",
    "map": "loop.plane:gain_map",
    "margins": "loop.margins",
    "explore": "report.live",
    "export": "exported",
    "Measured": "fitting.data",
    "fit": "fitting.fit",
    "modes": "spectrum",
    "Output": "exact.outputs",
    "overlay": "fitting.overlay",
    "plots": "plots",
    "read_measured": "fitting.data",
    "reduce": "reduced",
    "result_card": "assessment",
    "sampled": "loop.sampled_verdict",
    "simulate": "dsp.results",
    "spill": "loop.stability",
    "step": "assessment.step",
    "study": "studies.study",
    "transfer": "response",
    "tune": "tuner",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'tfarm' has no attribute {name!r}")
    room, _, other = _ROOMS.get(name, "errors" if name.endswith("Error") else "arm").partition(":")
    module = import_module(f"tfarm.{room}")
    value = module if room == name else getattr(module, other or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
