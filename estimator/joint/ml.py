"""Maximum likelihood of the centre: slack and skin as noise of any spectrum, and as noise locked to the motion.

R_T_P u + c = R_T_C v + e + slide. The slide is stationary in the parent's or the child's axes, whichever is likelier,
with a spectrum that the residuals tell (`noise`); and a part of it may depend on the joint's angles and rates, as that
of skin which keeps time with the gait. The random coefficients of such a part show in directions that the centre cannot
explain, and so tell how much it may have shifted the centre.

Only frequencies are used at which the bodies turn by much more than their attitudes are noisy: others tell nothing,
but look as if they did, as noise of the attitudes is correlated with that of the centroids.
"""

import numpy as np

from baryscope.estimator.adjustment.spurious import (
    FARTHEST_RADII,
    farthest,
    spurious_information_columns,
    three_sigma_factor,
)
from baryscope.estimator.geometry.so3 import log_rotation
from baryscope.estimator.joint.bodies import Pair
from baryscope.estimator.joint.noise import Fit, bands, restricted_likelihood, transformed
from baryscope.estimator.joint.result import Centre, Slide, residual_of
from baryscope.estimator.tracks import FloatArray

CLEAR = 100.0  # power of the turn over that of the attitudes' noise, in a band that is used
SMALLEST = 0.03  # singular value of a function of the motion over that of the greatest
LOOSE = 1 / 3  # of the markers' radius: a centre that is less certain in a direction is one of a hinge
MOST_SQUARES = 8  # functions that are products of angles and rates


def maximum_likelihood(pair: Pair) -> Centre:
    """The centre, of bodies that turn about more than one axis, if by their noise alone."""
    design, wanted = pair.equations
    functions, kept = motion_functions(pair.relative), clear_coefficients(pair)
    fits: list[Fit] = []
    for axes in (pair.parent_pose[0], pair.child.rotation):
        back = np.swapaxes(axes, 1, 2)
        moved = np.einsum("kij,kj->ki", back, wanted)
        fits.append(restricted_likelihood(back @ design, moved, functions, kept))
    in_child = bool(fits[1].likelihood > fits[0].likelihood)
    fit = fits[in_child]
    spurious = three_sigma_factor(kept) * float(np.sum(1 / fit.spectrum)) * _spurious(pair, in_child)
    reach = farthest(pair.child.markers)
    free, _ = spurious_information_columns(fit.covariance, np.zeros((6, 0)), spurious, 1 / reach**2)
    covariance = fit.covariance + free @ free.T
    variances, directions = np.linalg.eigh(covariance)
    return Centre(
        fit.found,
        covariance,
        bool(variances[-1] / 2 > (LOOSE / FARTHEST_RADII * reach) ** 2),  # half of (u, v) is in the child
        directions[:, -1],
        _slide(pair, fit),
    )


def motion_functions(R_P_C: FloatArray) -> list[FloatArray]:
    """Two groups of functions of time (n, q): combinations of the joint's angles and rates, and of their products.

    Each has the mean 0 and the square sum 1; they are orthogonal.
    """
    left, _, right = np.linalg.svd(R_P_C.mean(axis=0))
    mean = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    angle = log_rotation(mean.T @ R_P_C)
    rate = np.gradient(angle, axis=0)
    angle, rate = angle - angle.mean(axis=0), rate - rate.mean(axis=0)
    rate = rate * np.sqrt(np.sum(angle**2) / max(float(np.sum(rate**2)), 1e-300))
    linear = _orthogonal(np.concatenate([angle, rate], axis=1))
    i, j = np.triu_indices(linear.shape[1])
    products = linear[:, i] * linear[:, j]
    products = products - products.mean(axis=0)
    return [linear, _orthogonal(products - linear @ (linear.T @ products))[:, :MOST_SQUARES]]


def _orthogonal(values: FloatArray) -> FloatArray:
    """An orthonormal basis of the columns (n, q), without the smallest parts."""
    if not values.size:
        return values
    basis, size, _ = np.linalg.svd(values, full_matrices=False)
    return np.asarray(basis[:, size > max(SMALLEST * size[0], 1e-300)])


def clear_coefficients(pair: Pair) -> int:
    """How many coefficients along time show the bodies' turning against each other clearly."""
    power = np.sum(transformed(pair.relative) ** 2, axis=(1, 2))
    noise = sum(2 * np.trace(turn.mean(axis=0)) for turn in _turns(pair))
    ends = bands(len(power))
    mean = np.add.reduceat(power, ends[:-1]) / np.diff(ends)
    clear = np.nonzero(mean > CLEAR * noise)[0]
    return int(ends[max(clear[-1] if clear.size else 0, min(2, len(ends) - 2)) + 1])


def _turns(pair: Pair) -> list[FloatArray]:
    """The covariances (k, 3, 3), rad², of the attitudes by the markers' own noise, each in the body's axes."""
    return [body.attitude_noise(body.own_variance) for body in (pair.parent, pair.child) if body is not None]


def _spurious(pair: Pair, in_child: bool) -> FloatArray:
    """The mean information on (u, v), (6, 6), that a frame's noise of attitudes seems to give, in either's axes."""
    *parent, child = _turns(pair)
    R = pair.relative
    for one in parent:  # the relative attitude has the noise of both
        child = child + np.swapaxes(R, 1, 2) @ one @ R
    turn = (R @ child @ np.swapaxes(R, 1, 2) if in_child else child).mean(axis=0)
    own = slice(0, 3) if in_child else slice(3, 6)
    found = np.zeros((6, 6))
    found[own, own] = np.trace(turn) * np.eye(3) - turn
    return found


def _slide(pair: Pair, fit: Fit) -> Slide:
    """What the residuals consist of."""
    power = transformed(residual_of(pair, fit.found)) ** 2
    n, kept = len(power), len(fit.spectrum)
    white = float(np.mean(power[kept:])) if kept < n else float(fit.spectrum.min())
    ends = [(pair.child, fit.found[3:])] + ([] if pair.parent is None else [(pair.parent, fit.found[:3])])
    own = 0.0
    for body, lever in ends:
        turn = body.attitude_noise(body.own_variance).mean(axis=0)
        own += float(lever @ (np.trace(turn) * np.eye(3) - turn) @ lever) / 3
        own += body.own_variance / float(body.weights.sum(axis=1).mean())
    return Slide(
        white=float(np.sqrt(white)),
        correlated=float(np.sqrt(np.sum(np.maximum(fit.spectrum - white, 0)) / n)),
        locked=float(np.sqrt(np.mean(fit.locked**2))),
        of_markers=float(np.sqrt(own)),
    )
