"""Columns of numbers against CasADi's own evaluation, point by point."""

import casadi as ca
import numpy as np
import pytest

from baryscope.models.columns import BLOCK, FEW, OPERATIONS, ColumnFunction

A, B = ca.SX.sym("a"), ca.SX.sym("b", 2)
ONE_OF_EACH = ca.vertcat(
    A + B[0], A - B[0], A * B[0], A / B[0], -A, 1 / A, A**2, 2 * A, ca.sqrt(A), ca.log(A), ca.fabs(B[1]), ca.sign(B[1]),
    ca.floor(B[1]), ca.sin(A), ca.cos(A), ca.atan2(B[1], A), ca.hypot(A, B[1]),
    ca.fmin(A, B[1]), ca.fmax(A, B[1]), B[1] > A, ca.logic_not(B[0] < A), ca.logic_or(B[0] > A, B[1] > A),
    ca.if_else(B[0] < 0, B[1], A),
)  # fmt: skip


@pytest.mark.parametrize("count", [50, FEW + 50])
def test_every_operation(count):
    function = ca.Function("all", [A, B], [ONE_OF_EACH])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert used >= set(OPERATIONS)
    rng = np.random.default_rng(1)
    a, b = rng.uniform(0.1, 9, (1, count)), rng.uniform(-9, 9, (2, count))
    found = ColumnFunction("all", [A, B], ONE_OF_EACH)(a, b)
    assert found.shape == (count, ONE_OF_EACH.numel())
    np.testing.assert_allclose(found, np.array(function.map(count)(a, b)).T, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("count", [1, 2, FEW + 1])
def test_matrices_with_structural_zeros_and_inputs_that_are_the_same_everywhere(count):
    matrix = ca.vertcat(ca.horzcat(A, 0, B[0]), ca.horzcat(3, B[1], 0))
    found = ColumnFunction("matrix", [A, B], matrix)(np.arange(count)[None], [5.0, 7.0])
    np.testing.assert_array_equal(found, [[[at, 0, 5], [3, 7, 0]] for at in range(count)])


def test_a_matrix_of_nothing_but_structural_zeros():
    found = ColumnFunction("nothing", [A], ca.SX(2, 3))(np.arange(4.0)[None])
    np.testing.assert_array_equal(found, np.zeros((4, 2, 3)))


def test_arguments_may_lie_in_memory_in_any_way_and_be_read_only():
    a, b = np.arange(12.0).reshape(6, 2).T[:1, ::-1], np.broadcast_to([[5.0], [7.0]], (2, 6))
    found = ColumnFunction("sum", [A, B], A + B[0] + 2 * B[1])(a, b)
    np.testing.assert_array_equal(found[:, 0], [29, 27, 25, 23, 21, 19])


def test_an_infinite_or_missing_argument_has_a_result():
    found = ColumnFunction("quotient", [A, B], 1 / A + B[0])([[0.0, np.inf, np.nan]], [1.0, 2.0])
    np.testing.assert_array_equal(found, [[np.inf], [1], [np.nan]])


@pytest.mark.parametrize("count", [2, FEW + 2])
def test_what_is_not_chosen_may_be_infinite(count):
    chosen = ColumnFunction("chosen", [A, B], ca.if_else(A < 2, B[0], B[1]))
    found = chosen(np.arange(1.0, count + 1)[None], [5.0, np.inf])
    np.testing.assert_array_equal(found[:, 0], [5.0, *[np.inf] * (count - 1)])


@pytest.mark.parametrize("count", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 3])
def test_any_number_of_points(count):
    values = np.arange(count, dtype=float)
    np.testing.assert_array_equal(ColumnFunction("double", [A], 2 * A)(values[None]), 2 * values[:, None])


@pytest.mark.parametrize("count", [1, FEW - 1, FEW, FEW + 1, BLOCK + 1])
@pytest.mark.parametrize("same", [None, 0, 1])
def test_a_long_function_of_few_and_many_points(count, same):
    """The recurrences of Hénon's map and of one number alone, which reuse memory in a different order."""
    rng = np.random.default_rng(count)
    a, b = rng.uniform(0.2, 0.3, (1, count)), rng.uniform(0, 0.3, (2, count))
    arguments = [x[:, 0] if same == index else x for index, x in enumerate((a, b))]
    given = [x.copy() for x in arguments]

    def recurrence(a, b):
        x, y, alone = b[0], b[1], a
        for _ in range(200):
            x, y, alone = 1 - a * x * x + y, 0.3 * x, alone - alone * alone * b[0]
        return x, y, alone

    x, y, alone = recurrence(A, B)
    found = ColumnFunction("long", [A, B], ca.vertcat(ca.horzcat(x, 0), ca.horzcat(alone, y)))(*arguments)
    expected = np.zeros((count, 2, 2))
    expected[:, 0, 0], expected[:, 1, 1], expected[:, 1, 0] = recurrence(arguments[0][0], arguments[1])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    for before, after in zip(given, arguments, strict=True):
        np.testing.assert_array_equal(after, before)


def test_a_result_that_is_the_same_everywhere():
    found = ColumnFunction("same", [A, B], ca.vertcat(A, 2 * B[0], 3))(np.arange(3.0)[None], [5.0, 7.0])
    np.testing.assert_array_equal(found, [[0, 10, 3], [1, 10, 3], [2, 10, 3]])


def test_arguments_of_another_shape():
    function = ColumnFunction("sum", [A, B], A + B[0] + B[1])
    with pytest.raises(ValueError, match=r"sum: argument 1 has the shape \(3, 4\), expected 2 rows"):
        function(np.zeros((1, 4)), np.zeros((3, 4)))


def test_an_operation_that_is_missing():
    with pytest.raises(NotImplementedError, match="tangent: operation"):
        ColumnFunction("tangent", [A], ca.tan(A))
