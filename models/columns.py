"""CasADi functions evaluated for many points at once, by NumPy over columns.

`casadi.Function.map` runs through the points one after the other and hands the results over number by number. Here each
instruction of the function runs once, over all points: several times faster, and the formula still stands once.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_INV: np.reciprocal,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_SQRT: np.sqrt,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_FLOOR: np.floor,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_HYPOT: np.hypot,
}
BLOCK = 16384  # points at a time, so that results are written while they are in the processor's cache


class ColumnFunction:
    """One expression of some symbols, to be evaluated at n points at once.

    Args:
        name: for messages.
        symbols: the inputs, columns.
        expression: a column or a matrix.

    Raises:
        NotImplementedError: the expression needs an operation that OPERATIONS lacks.
    """

    def __init__(self, name: str, symbols: list[ca.SX], expression: ca.SX) -> None:
        function = ca.Function(name, symbols, [expression], {"cse": True})
        self.name = name
        self.shape = function.size_out(0)
        self.input_rows = [function.nnz_in(index) for index in range(function.n_in())]
        sparsity = function.sparsity_out(0)
        self._places = list(zip(sparsity.row(), sparsity.get_col(), strict=True))
        self._steps = [_step(function, k) for k in range(function.n_instructions())]

    def __call__(self, *arguments: ArrayLike) -> FloatArray:
        """Evaluate.

        Args:
            arguments: one for each input: (rows,) for what is the same at all points, or (rows, n).

        Returns:
            (n, rows) for a column, (n, rows, columns) for a matrix.

        Raises:
            ValueError: an argument has not as many rows as its input.
        """
        inputs = [np.asarray(argument, dtype=np.float64) for argument in arguments]
        for index, (values, rows) in enumerate(zip(inputs, self.input_rows, strict=True)):
            if values.ndim not in (1, 2) or len(values) != rows:
                raise ValueError(f"{self.name}: argument {index} has the shape {values.shape}, expected {rows} rows")
        n = next((values.shape[1] for values in inputs if values.ndim == 2), 1)
        result = np.zeros((n, *self.shape))
        for start in range(0, n, BLOCK):
            block = slice(start, start + BLOCK)
            self._run([values[:, block] if values.ndim == 2 else values for values in inputs], result[block])
        return result[:, :, 0] if self.shape[1] == 1 else result

    def _run(self, inputs: list[FloatArray], result: FloatArray) -> None:
        """Carry out the instructions and write the nonzeros to `result`, (n, rows, columns)."""
        work: dict[int, Any] = {}
        for operation, sources, targets, constant in self._steps:
            if operation == ca.OP_INPUT:
                work[targets[0]] = inputs[sources[0]][sources[1]]
            elif operation == ca.OP_OUTPUT:
                row, column = self._places[targets[1]]
                result[:, row, column] = work[sources[0]]
            elif operation == ca.OP_CONST:
                work[targets[0]] = constant
            else:
                work[targets[0]] = OPERATIONS[operation](*(work[source] for source in sources))


def _step(function: ca.Function, k: int) -> tuple[int, list[int], list[int], float]:
    """Operation, places of its operands, place of its result, and constant of an instruction."""
    operation = function.instruction_id(k)
    if operation not in OPERATIONS and operation not in (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST):
        raise NotImplementedError(f"{function.name()}: operation {operation} of CasADi has no counterpart here")
    constant = function.instruction_constant(k) if operation == ca.OP_CONST else 0.0
    return operation, function.instruction_input(k), function.instruction_output(k), constant
