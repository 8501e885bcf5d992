"""Speed, memory and accuracy, beside other packages: `make bench`.

Every package works on one thread here: its linear algebra, waiting for a second core that is busy, can take twenty
times as long.  That has to be said before NumPy is imported.
"""

import os

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_threads] = "1"
