"""Names for the types of arrays."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
Image = NDArray[np.uint8]  # (H, W, 3) BGR, or with alpha (H, W, 4)
Mask = NDArray[np.uint8]  # (H, W), 0 or 1
