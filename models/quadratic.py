"""A quadratic right-hand side as weighted products of its states, for the recurrence of its Taylor series.

With f(x) = f(0) + Σ w x_i x_j the coefficients of x(t) = Σ x_k t^k follow from convolutions of the products alone:
(k + 1) x_{k+1} = Σ w P_ij, P_ij the sum of x_{m,i} x_{k-m,j} over m = 0 … k, for k ≥ 1 (Jorba, Zou, A software package
for the numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14, 2005, §2).
"""

from dataclasses import dataclass

import casadi as ca

from baryscope.models.frames import Symbol


@dataclass(frozen=True)
class QuadraticForm:
    """The quadratic part of f; every product contains one of a few states, the factors.

    Attributes:
        weights: c → w, the weights from the constants c.
        rates: products (states × factors), w → the quadratic part of the rates.
    """

    weights: ca.Function
    rates: ca.Function


def quadratic_form(name: str, rates: Symbol, x: Symbol, c: Symbol, factors: slice) -> QuadraticForm:
    """Find the form from the second derivatives of `rates` by x; every product must contain one of x[factors].

    Raises:
        ValueError: the rates are not such a form plus a constant.
    """
    columns = list(range(x.numel()))[factors]
    slopes = ca.jacobian(rates, x)
    others = [i for i in range(x.numel()) if i not in columns]
    by_column = [_coefficients(slopes[:, j], x, columns[: columns.index(j)], j) for j in columns]
    w = ca.sparsify(ca.horzcat(*by_column))
    linear = ca.sparsify(ca.substitute(slopes, x, ca.SX.zeros(x.numel())))
    if ca.depends_on(w, x) or linear.nnz() or ca.jacobian(ca.vec(slopes[:, others]), x[others]).nnz():
        raise ValueError(f"{name}: found other terms than products with the states {columns} and constants")
    products, weights = ca.SX.sym("products", x.numel(), len(columns)), ca.SX.sym("w", w.nnz())
    return QuadraticForm(
        ca.Function(f"{name}_weights", [c], [w.nz[:]], ["c"], ["w"]),
        ca.Function(
            f"{name}_products",
            [products, weights],
            [ca.densify(ca.SX(w.sparsity(), weights) @ ca.vec(products))],
            ["products", "w"],
            ["xdot"],
        ),
    )


def _coefficients(slopes: Symbol, x: Symbol, done: list[int], j: int) -> Symbol:
    """Coefficients of x_i x_j in the rates, a column for each i; products with a factor in `done` are left out."""
    matrix = ca.jacobian(slopes, x)
    for i in done:
        matrix[:, i] = 0
    matrix[:, j] /= 2
    return matrix
