"""``@compiled``: the loops of the filters as machine code, and the arrays they take."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from avionics.compiler import IS_COMPILED, cached_compiler

__all__ = ["IS_COMPILED", "Array", "IndexArray", "compiled"]

Array = NDArray[np.float64]
IndexArray = NDArray[np.int64]
compiled = cached_compiler("pos", Path(__file__).parent.glob("*.py"))
