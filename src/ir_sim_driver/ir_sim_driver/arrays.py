"""The one array type of the driver: float64, joints last."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
