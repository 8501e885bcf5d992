"""The excitation of an experiment as C99: one file, with every bit of its samples."""

from tfarm.exported.texts import literal, render_source
from tfarm.fitting.experiment import Experiment


def excitation_code(found: Experiment) -> bytes:
    """Return a file in C with `double tfarm_excitation(long k)`, the input held from sample k to the next."""
    numbers = list(map(literal, found.input.tolist()))
    return render_source("excitation.c", found=found, numbers=numbers)
