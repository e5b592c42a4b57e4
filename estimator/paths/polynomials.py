"""Polynomials through values at nodes: Lagrange's, and Hermite's between evenly spaced ones for many times at once."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def lagrange_weights(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """The weights (n, k) of values at nodes (k,) in the polynomial through them, at (n,)."""
    apart = nodes[:, None] - nodes + np.eye(len(nodes))
    weights, before, after = np.empty((len(nodes), len(at))), np.ones(len(at)), np.ones(len(at))
    for weight, node in zip(weights, nodes, strict=True):
        weight[:] = before
        before *= at - node
    for weight, node, scale in zip(weights[::-1], nodes[::-1], np.prod(apart, axis=1)[::-1], strict=True):
        weight *= after / scale
        after *= at - node
    return weights.T


def cubic(s: FloatArray, left: IntArray, f: FloatArray, df: FloatArray) -> FloatArray:
    """The cubic through values f (k, c) and derivatives df (k, c) per interval at nodes `left` (n,) and the next ones.

    s (n,) is the fraction of the interval, 0 to 1; returns (n, c).
    """
    before, slope_before, after, slope_after = cubic_weights(s).T[:, :, None]
    value: FloatArray = before * f[left] + after * f[left + 1]
    value += slope_before * df[left] + slope_after * df[left + 1]
    return value


def cubic_weights(s: FloatArray) -> FloatArray:
    """The weights (n, 4) in that cubic of f and df at the node before, and of f and df at the one after."""
    s2, s3 = s * s, s * s * s
    h01 = 3 * s2 - 2 * s3
    return np.stack([1 - h01, s - 2 * s2 + s3, h01, s3 - s2], axis=1)


def cubic_slope_weights(s: FloatArray) -> FloatArray:
    """The weights (n, 4) in the derivative of the cubic by s."""
    h01 = 6 * s - 6 * s * s
    return np.stack([-h01, 1 - 4 * s + 3 * s * s, h01, 3 * s * s - 2 * s], axis=1)


def quintic(
    s: FloatArray, left: IntArray, f: FloatArray, df: FloatArray, ddf: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The quintic through values, first and second derivatives (k, c) per interval; arguments as in `cubic`.

    Returns (n, c) and its derivative (n, c) by s.
    """
    s = s[:, None]
    s2, s3 = s * s, s * s * s
    s4, s5 = s2 * s2, s2 * s3
    h0, dh0 = 10 * s3 - 15 * s4 + 6 * s5, 30 * (s2 - 2 * s3 + s4)
    f, f_after, df, df_after, ddf, ddf_after = f[left], f[left + 1], df[left], df[left + 1], ddf[left], ddf[left + 1]
    value: FloatArray = (1 - h0) * f + h0 * f_after
    value += (s - 6 * s3 + 8 * s4 - 3 * s5) * df + (-4 * s3 + 7 * s4 - 3 * s5) * df_after
    value += 0.5 * (s2 - 3 * s3 + 3 * s4 - s5) * ddf + 0.5 * (s3 - 2 * s4 + s5) * ddf_after
    slope: FloatArray = dh0 * (f_after - f)
    slope += (1 - 18 * s2 + 32 * s3 - 15 * s4) * df + (-12 * s2 + 28 * s3 - 15 * s4) * df_after
    slope += 0.5 * (2 * s - 9 * s2 + 12 * s3 - 5 * s4) * ddf + 0.5 * (3 * s2 - 8 * s3 + 5 * s4) * ddf_after
    return value, slope
