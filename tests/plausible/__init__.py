"""Refusals and wrong results for plausible arms, by every command: `python -m tests.plausible`.

Linear algebra runs on one thread here, which has to be set before NumPy is imported: arms are shared out over
processes.
"""

import os

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_threads, "1")
