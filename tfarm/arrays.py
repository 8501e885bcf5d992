"""The arrays of every room, for readers and for mypy: real, complex and whole numbers in double precision."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Whole = NDArray[np.int64]
