"""CasADi functions of a few columns that are called thousands of times: through buffers, in microseconds."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Columns:
    """A function of dense columns with one dense result, for k sets of arguments at once; not thread-safe.

    Args:
        function: its inputs and its output are columns.
        k: number of sets.
    """

    def __init__(self, function: ca.Function, k: int) -> None:
        mapped = function.map(k) if k > 1 else function
        self._arguments = [np.zeros((k, function.numel_in(index))) for index in range(function.n_in())]
        self._result = np.zeros((k, function.numel_out(0)))
        buffer: Any
        buffer, run = mapped.buffer()
        for index, argument in enumerate(self._arguments):
            buffer.set_arg(index, argument.data)
        buffer.set_res(0, self._result.data)
        self._buffer, self._run = buffer, run  # the buffer must live as long as the function that uses it

    def __call__(self, *arguments: Any) -> FloatArray:
        """The result (k, rows) for arguments (k, rows), or arguments that broadcast to it."""
        for own, argument in zip(self._arguments, arguments, strict=True):
            own[:] = argument
        self._run()
        return self._result.copy()
