"""CasADi functions evaluated for many points at once, by NumPy over columns.

For many points each instruction of the function runs once, over all points. For few CasADi's own virtual machine is
faster: it goes from point to point, and reads and writes NumPy's memory, as to convert numbers one by one, which a call
of a `casadi.Function` does, takes longer than to evaluate them. Either way the formula is written once.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def _or_zero(condition: FloatArray, value: FloatArray, out: FloatArray) -> FloatArray:
    """The value where the condition holds, whatever the value is elsewhere."""
    out[...] = np.where(condition, value, 0.0)
    return out


OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_INV: np.reciprocal,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a, out: np.add(a, a, out),
    ca.OP_SQRT: np.sqrt,
    ca.OP_LOG: np.log,
    ca.OP_FABS: np.abs,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_SIGN: np.sign,
    ca.OP_FLOOR: np.floor,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_HYPOT: np.hypot,
    ca.OP_LT: np.less,
    ca.OP_OR: np.logical_or,
    ca.OP_NOT: np.logical_not,
    ca.OP_IF_ELSE_ZERO: _or_zero,
}
BLOCK = 16384  # points at a time: many for one call of NumPy, few for the processor's cache
# Up to so many points CasADi is faster, as timeit on `relative_path` tells: NumPy needs time to begin an instruction.
FEW = 180


def evaluate(function: ca.Function, arguments: Sequence[FloatArray], nonzeros: FloatArray) -> None:
    """A function of CasADi that reads and writes NumPy's memory.

    arguments: one for each input, with its columns as rows; nonzeros: of the result, likewise, to be written.
    """
    buffer: Any  # whose sizes are those of the memory, which CasADi's types do not know
    buffer, run = function.buffer()
    held = [np.ascontiguousarray(argument) for argument in arguments]  # until they are read
    for index, argument in enumerate(held):
        buffer.set_arg(index, argument.data)
    buffer.set_res(0, nonzeros.data)
    run()


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
        self._function = function
        self.shape = function.size_out(0)
        self.input_rows = [function.nnz_in(index) for index in range(function.n_in())]
        sparsity = function.sparsity_out(0)
        self._places = sparsity.row(), sparsity.get_col()
        self._nonzeros = sparsity.nnz()
        self._constants, self._steps = _program(function)
        self._mapped: dict[int, Any] = {}  # at most FEW, as to make one takes longer than to evaluate it

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
        result = self._point_by_point(inputs, n) if 0 < n <= FEW else self._over_columns(inputs, n)
        return result[:, :, 0] if self.shape[1] == 1 else result

    def _point_by_point(self, inputs: list[FloatArray], n: int) -> FloatArray:
        if n not in self._mapped:
            self._mapped[n] = self._function.map(n)
        points = [np.broadcast_to(values.T, (n, len(values))) for values in inputs]
        nonzeros = np.empty((n, self._nonzeros))
        evaluate(self._mapped[n], points, nonzeros)
        if self.shape == (self._nonzeros, 1):
            return nonzeros[:, :, None]
        result = np.zeros((n, *self.shape))
        row, column = self._places
        result[:, row, column] = nonzeros
        return result

    def _over_columns(self, inputs: list[FloatArray], n: int) -> FloatArray:
        result = np.zeros((n, *self.shape))
        memory = np.empty((self._function.sz_w(), min(n, BLOCK)))
        for start in range(0, n, BLOCK):
            block = slice(start, start + BLOCK)
            rows = [row[block] if row.ndim else row for values in inputs for row in map(np.asarray, values)]
            self._run(rows, memory[:, : n - start], result[block])
        return result

    def _run(self, rows: list[FloatArray], memory: FloatArray, result: FloatArray) -> None:
        """Carry out the steps on the inputs' rows and write the nonzeros to `result`, (n, rows, columns).

        memory: (places, n), for intermediate columns; allocating each would cost more than the operations.
        """
        nonzeros = [result[:, row, column] for row, column in zip(*self._places, strict=True)]
        columns, numbers = [*memory, *nonzeros], [*(np.empty(()) for _ in memory), *nonzeros]
        values = [*rows, *self._constants]
        for operation, first, second, place in self._steps:
            a = values[first]
            if second is None:
                values.append(operation(a, (columns if a.ndim else numbers)[place]))
            else:
                b = values[second]
                values.append(operation(a, b, (columns if a.ndim or b.ndim else numbers)[place]))


# An operation; its one or two operands among the values, which are the inputs' rows, the constants, and the results of
# the steps so far; the place of its result, which is one in memory or, counted on from there, a nonzero of the output.
_Step = tuple[Callable[..., Any], int, int | None, int]


def _program(function: ca.Function) -> tuple[list[FloatArray], list[_Step]]:
    """The constants and the steps of a function."""
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    constants = [np.asarray(function.instruction_constant(k)) for k, code in enumerate(codes) if code == ca.OP_CONST]
    first_row = np.cumsum([0, *(function.nnz_in(index) for index in range(function.n_in()))]).tolist()
    first_result = first_row[-1] + len(constants)
    next_constant = iter(range(first_row[-1], first_result))
    steps: list[_Step] = []
    held: dict[int, int] = {}  # place in memory → the value there
    for k, code in enumerate(codes):
        sources, targets = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            held[targets[0]] = first_row[sources[0]] + sources[1]
        elif code == ca.OP_CONST:
            held[targets[0]] = next(next_constant)
        elif code == ca.OP_OUTPUT:
            steps.append((np.positive, held[sources[0]], None, function.sz_w() + targets[1]))
        elif code in OPERATIONS:
            second = held[sources[1]] if len(sources) == 2 else None
            steps.append((OPERATIONS[code], held[sources[0]], second, targets[0]))
            held[targets[0]] = first_result + len(steps) - 1
        else:
            raise NotImplementedError(f"{function.name()}: operation {code} of CasADi has no counterpart here")
    return constants, steps
