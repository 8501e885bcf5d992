"""Is anybody turned away, or told something wrong?  Plausible arms through every verb: `python -m tests.plausible`.

Linear algebra runs on one thread here, which has to be said before NumPy is imported: arms are shared out over
processes.
"""

import os

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_threads, "1")
