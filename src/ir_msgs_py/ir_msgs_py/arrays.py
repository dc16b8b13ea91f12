"""The array types of the project, declared once: float64, int64 and bool. Shapes stand in
docstrings.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
