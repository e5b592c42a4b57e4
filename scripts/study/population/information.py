"""The Cramér–Rao bound of the path of a case: the least covariance that any unbiased estimate can have.

Observations are y = p(x) + R b plus noise; a rotation by φ in B moves them by −R [b]× φ. Their weighted squares
give the information on x, the points b and either a free φ in every frame, which is eliminated there, or the φ of a
free tumble, eight unknowns. The rotation of the body's axes (of all points together) is no unknown: a prior holds it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FAR = 1e3  # m, a prior's standard deviation of the path and the points: unobserved directions stay finite


@dataclass(frozen=True, eq=False)
class Watched:
    """What is seen of a body: attitude (n, 3, 3) R_C_B; points (m, 3) in B; precision (n, m, 3, 3) in C of the
    observations, used where right (n, m). turn (n, 3, t): rotation vectors in B by the unknowns of the tumble; None
    leaves the attitudes free.
    """

    attitude: FloatArray
    points: FloatArray
    precision: FloatArray
    right: BoolArray
    turn: FloatArray | None = None


def path_bound(jacobian: FloatArray, watched: Watched) -> FloatArray:
    """Bound (n, 3, 3) of the covariance of the path in C at n times, m²; see `unknowns_bound`."""
    return np.asarray(jacobian @ unknowns_bound(jacobian, watched) @ np.swapaxes(jacobian, 1, 2))


def unknowns_bound(jacobian: FloatArray, watched: Watched, prior: FloatArray | float = 0.0) -> FloatArray:
    """Bound (p, p) of the covariance of the unknowns x of the path.

    jacobian (n, 3, p): of the path by x; prior (p,): information that is had on each of x.
    """
    attitude, turn, right = watched.attitude, watched.turn, watched.right
    some = right.any(axis=0)
    points, precision, right = watched.points[some], watched.precision[:, some], right[:, some]
    n, m, p = len(jacobian), len(points), jacobian.shape[2]
    q = p + 3 * m
    W = np.einsum("nji,nmjk,nkl->nmil", attitude, precision, attitude, optimize=True) * right[..., None, None]
    A = np.swapaxes(attitude, 1, 2) @ jacobian
    K = cross_of(-points)
    KW = np.swapaxes(K, 1, 2) @ W
    F, all_W = (KW @ K).sum(axis=1), W.sum(axis=1)
    G = np.concatenate([KW.sum(axis=1) @ A, KW.transpose(0, 2, 1, 3).reshape(n, 3, 3 * m)], axis=2)
    M = np.zeros((q, q))
    M[:p, :p] = np.einsum("nip,nij,njq->pq", A, all_W, A, optimize=True)
    M[:p, p:] = np.einsum("nip,nmij->pmj", A, W, optimize=True).reshape(p, 3 * m)
    M[p:, :p] = M[:p, p:].T
    for index, block in enumerate(W.sum(axis=0)):
        own = slice(p + 3 * index, p + 3 * index + 3)
        M[own, own] += block
    spread = np.sqrt(np.mean(np.sum(jacobian**2, axis=1), axis=0))
    M[np.arange(q), np.arange(q)] += np.concatenate([spread**2, np.ones(3 * m)]) / FAR**2
    M[np.arange(p), np.arange(p)] += prior
    sizes = np.diag(M).copy()
    if turn is None:
        M -= np.tensordot(G, np.linalg.pinv(F, rcond=1e-12, hermitian=True) @ G, ([0, 1], [0, 1]))
        gauge = np.concatenate([np.zeros((p, 3)), K.reshape(3 * m, 3)])
        M += gauge @ gauge.T * (np.trace(M[p:, p:]) / max(3 * m, 1))
        return _inverse(M, sizes)[:p, :p]
    by_turn = np.einsum("nit,niq->tq", turn, G, optimize=True)
    own_turn = np.einsum("nit,nij,nju->tu", turn, F, turn, optimize=True)
    weak = np.diag(np.ones(len(own_turn)))  # rad/s, or of the trace: no information
    full = np.block([[M, by_turn.T], [by_turn, own_turn + weak]])
    return _inverse(full, np.diag(full))[:p, :p]


def polynomial_jacobian(time: FloatArray, degree: int) -> FloatArray:
    """Jacobian (n, 3, 3 (degree + 1)) of a polynomial path in Chebyshev's basis over the span of the times."""
    scaled = 2 * (time - time[0]) / (time[-1] - time[0]) - 1
    terms = np.polynomial.chebyshev.chebvander(scaled, degree)
    return np.asarray(np.einsum("nd,ij->nidj", terms, np.eye(3)).reshape(len(time), 3, 3 * (degree + 1)))


def polynomial_misfit(time: FloatArray, path: FloatArray, degree: int) -> float:
    """The rms distance in m of a path (n, 3) from its best polynomial."""
    terms = polynomial_jacobian(time, degree)[:, 0, ::3]
    best, *_ = np.linalg.lstsq(terms, path, rcond=None)
    return float(np.sqrt(((path - terms @ best) ** 2).sum(axis=1).mean()))


def rms(covariance: FloatArray) -> float:
    """The root of the mean squared error of a covariance (n, 3, 3), m."""
    return float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))


def cross_of(v: FloatArray) -> FloatArray:
    """[v]× (m, 3, 3)."""
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)


def _inverse(M: FloatArray, sizes: FloatArray) -> FloatArray:
    """The inverse of a positive definite matrix, singular perhaps but for rounding, of quantities of those sizes."""
    scale = 1 / np.sqrt(sizes)
    values, vectors = np.linalg.eigh(M * scale * scale[:, None])
    half = scale[:, None] * vectors / np.sqrt(np.maximum(values, 1e-15 * values[-1]))
    return np.asarray(half @ half.T)
