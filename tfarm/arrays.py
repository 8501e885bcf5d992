"""Types of arrays, real, complex and whole numbers in double precision, and the limits of these."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Whole = NDArray[np.int64]

# in place of 0 in a denominator or logarithm
LEAST_SIZE = 1e-300
# of a double, to be multiplied by counts of operations
MACHINE_EPS = float(np.finfo(float).eps)
