"""Maximum likelihood of the centre: slack and skin as noise of any spectrum, and as noise locked to the motion.

R_T_P u + c = R_T_C v + e + slide. The slide is stationary in the parent's or the child's axes, whichever is likelier,
with a spectrum that the residuals tell (`noise`); and a part of it may depend on the joint's angles and rates, as that
of skin which keeps time with the gait: linearly on the angles in the axes of either body, and in the parent's as any
combination of angles, rates and their products, which are then of one size, as in a gait. The random coefficients of
such a part show in directions that the centre cannot explain, and so tell how much it may have shifted the centre.
Markers that follow the angles each by itself turn the attitudes wrong, by as much as their residuals tell: what that
does to the slide, in first order as the angles and in second as their products, is of a size that is known.

Only those frequencies are used at which the bodies turn by far more than their attitudes are noisy: others tell little,
but look as if they did, as noise of the attitudes is correlated with that of the centroids.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from baryscope.estimator.adjustment.spurious import (
    FARTHEST_RADII,
    SpuriousInformation,
    farthest,
    spurious_information_columns,
)
from baryscope.estimator.geometry.so3 import cross_matrices, log_rotation, squared_cross
from baryscope.estimator.joint.bodies import LARGEST_SLIDE, Body, Pair
from baryscope.estimator.joint.noise import Fit, band_variances, bands, restricted_likelihood, transformed
from baryscope.estimator.joint.result import Centre, Slide, residual_of, untold
from baryscope.estimator.tracks import FloatArray, IntArray

CLEAR = 1000.0  # power of the turn over that of the attitudes' noise, in a coefficient that is used
LEAST_COEFFICIENTS = 4  # in time, the slowest, that are used whatever the turn
SMALLEST = 0.03  # singular value of a function of the motion over that of the greatest
LOOSE = 1 / 3  # of the markers' radius: a centre that is less certain in a direction is one of a hinge
COEFFICIENTS_PER_FUNCTION = 4  # along time, of the markers' own noise, at least
MOST_SQUARES = 8  # functions that are products of angles and rates


def maximum_likelihood(pair: Pair, told: FloatArray) -> Centre:
    """The centre; told (6, q): the directions of (u, v) of which the motion tells, if by the bodies' noise alone."""
    fit, in_child, _ = likeliest_slide(pair, told, of_wrong_turns(pair))
    spurious = SpuriousInformation.of(_spurious(pair, in_child, fit), len(fit.kept))
    reach = farthest(pair.child.markers)
    of_told = told @ fit.covariance @ told.T
    free, _ = spurious_information_columns(of_told, np.zeros((6, 0)), spurious, 1 / reach**2)
    covariance = of_told + free @ free.T + untold(told, reach)
    variances, directions = np.linalg.eigh(covariance)
    found = told @ fit.found
    return Centre(
        found,
        covariance,
        bool(variances[-1] / 2 <= (LOOSE / FARTHEST_RADII * reach) ** 2),  # half of (u, v) is in the child
        directions[:, -1],
        _slide(pair, fit, found),
    )


def likeliest_slide(
    pair: Pair, told: FloatArray, known: Sequence[FloatArray] = ()
) -> tuple[Fit, bool, list[FloatArray]]:
    """The fit in the axes of parent or child, whichever are likelier; whether they are the child's; and, in T, the
    groups of functions (n, 3, q) of the motion that the slide may have.

    known: functions of time (n, 3, q) along the axes of parent and child, each times a unit normal number, which it has
    besides.
    """
    design, wanted = pair.equations
    kept = clear_coefficients(pair)
    fits: list[Fit] = []
    for axes in (pair.parent_pose[0], pair.child.rotation):
        back = np.swapaxes(axes, 1, 2)
        bodies = [back @ pair.parent_pose[0], back @ pair.child.rotation]
        functions = motion_functions(pair, bodies, of_one_size=pair.parent is not None)
        sure = [body @ one for one, body in zip(known, bodies, strict=False)]
        moved = np.einsum("kij,kj->ki", back, wanted)
        fits.append(restricted_likelihood(back @ design @ told, moved, functions, kept, sure))
        if len(fits) == 1 or fits[1].likelihood > fits[0].likelihood:
            found = [axes @ one for one in functions]
    in_child = bool(fits[1].likelihood > fits[0].likelihood)
    return fits[in_child].over_variances(LARGEST_SLIDE * pair.child.radius), in_child, found


def motion_functions(pair: Pair, coordinates: Sequence[FloatArray], of_one_size: bool = False) -> list[FloatArray]:
    """Groups of what skin may do with the motion, (n, c, q): functions of time along the axes of some coordinates.

    Along the axes of each of the coordinates (n, c, k): the joint's angles; along those of the first: combinations of
    angles and rates of one size, and of their products. As functions of time they have the mean 0.

    of_one_size: the angles along all coordinates are one group: the skin of one body slides with them as that of the
    other does. Else what both together show is taken for that of one, as of a hinge along its axis, and the other's,
    which shifts the centre as much across it, for none.
    """
    angle, linear, squares = _of_motion(pair)
    of_bodies = [np.concatenate(coordinates, axis=2)] if of_one_size else list(coordinates)
    groups = [(angle, axes) for axes in of_bodies] + [(linear, coordinates[0]), (squares, coordinates[0])]
    return [_along(one, axes) for one, axes in groups if one.size]


def _along(functions: FloatArray, axes: FloatArray) -> FloatArray:
    """Functions of time (n, i) along each of the axes (n, c, k): (n, c, k i)."""
    n, c, _ = axes.shape
    return np.asarray(np.einsum("ni,nck->ncki", functions, axes).reshape(n, c, -1))


@lru_cache(maxsize=1)
def _of_motion(pair: Pair) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Functions of time of the mean 0: the angles (n, 3), rad; and orthonormal ones, combinations of angles and rates
    (n, q), and of their products (n, r) across these.
    """
    angle = angles(pair.relative)
    rate = np.gradient(angle, axis=0)
    angle, rate = angle - angle.mean(axis=0), rate - rate.mean(axis=0)
    rate = rate * np.sqrt(np.sum(angle**2) / max(float(np.sum(rate**2)), 1e-300))
    linear = _orthogonal(np.concatenate([angle, rate], axis=1))
    products = _products(linear)
    found = angle, linear, _orthogonal(products - linear @ (linear.T @ products))[:, :MOST_SQUARES]
    for one in found:
        one.setflags(write=False)  # they are the next caller's, too
    return found


def _products(values: FloatArray) -> FloatArray:
    """All products (n, q (q + 1) / 2) of two of the columns (n, q), of the mean 0."""
    i, j = np.triu_indices(values.shape[1])
    products = values[:, i] * values[:, j]
    return np.asarray(products - products.mean(axis=0))


def angles(R_P_C: FloatArray) -> FloatArray:
    """The joint's angles (n, 3), rad, of R_P_C (n, 3, 3): the turn from its mean, in the child's axes."""
    left, _, right = np.linalg.svd(R_P_C.mean(axis=0))
    mean = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return log_rotation(mean.T @ R_P_C)


def _orthogonal(values: FloatArray) -> FloatArray:
    """An orthonormal basis of the columns (n, q), without the smallest parts."""
    if not values.size:
        return values
    basis, size, _ = np.linalg.svd(values, full_matrices=False)
    return np.asarray(basis[:, size > max(SMALLEST * size[0], 1e-300)])


def clear_coefficients(pair: Pair, clear: float = CLEAR) -> IntArray:
    """Which coefficients along time (k,) show the bodies' turning against each other clearly; at least the first.

    clear: the least ratio of its power to that of the attitudes' noise.
    """
    power = np.sum(transformed(pair.relative) ** 2, axis=(1, 2))
    noise = sum(2 * np.trace(turn.mean(axis=0)) for turn, _ in _turns(pair))
    shown = power > clear * noise
    shown[:LEAST_COEFFICIENTS] = True
    return np.nonzero(shown)[0]


@lru_cache(maxsize=2)  # of both bodies
def own_power(pair: Pair, body: Body) -> FloatArray:
    """The variance of the markers' own noise in each coefficient along time (k,), m² per coordinate: without what is a
    function of the motion.

    What skin does to single markers lasts: much of it is at the low frequencies of the motion. What of it follows the
    motion turns the body as the motion does, and is in the slide that does: it feigns no information beside that.
    Of second order in wrong attitudes that is all products of the angles.
    """
    angle, linear, _ = _of_motion(pair)
    functions = np.concatenate([linear, _orthogonal(_products(angle))], axis=1)
    functions = functions[:, : len(linear) // COEFFICIENTS_PER_FUNCTION]
    basis = np.linalg.qr(transformed(functions))[0]
    own = transformed(np.swapaxes(body.rotation, 1, 2)[:, None] @ np.nan_to_num(body.residual)[..., None])
    own = own.reshape(len(own), -1)
    left = np.sum((own - basis @ (basis.T @ own)) ** 2, axis=1)
    of_bands = band_variances(left[:, None], (1 - np.sum(basis**2, axis=1))[:, None], bands(len(own)))
    power = np.asarray(body.own_variance * of_bands / max(float(np.mean(np.sum(own**2, axis=1))), 1e-300))
    power.setflags(write=False)  # it is the next caller's, too
    return power


def _turns(pair: Pair) -> list[tuple[FloatArray, FloatArray]]:
    """The covariances (k, 3, 3), rad², of the attitudes of parent, if there is one, and child, each in its axes, by the
    markers' own noise, and what each coefficient of that along time (k,) has of it, 1 on average.
    """
    bodies = [body for body in (pair.parent, pair.child) if body is not None]
    powers = [own_power(pair, body) for body in bodies]
    means = [float(np.mean(power)) for power in powers]
    return [
        (body.attitude_noise(mean), power / max(mean, 1e-300))
        for body, power, mean in zip(bodies, powers, means, strict=True)
    ]


def relative_noise(pair: Pair, weight: Callable[[FloatArray], float] = lambda _: 1.0) -> FloatArray:
    """The covariances (k, 3, 3), rad², of the child's attitudes against the parent's by the markers' own noise, in the
    child's axes; `weight` is a factor on that of a body, of its share in each coefficient along time (k,).
    """
    return _of_child(pair, [weight(share) * turn for turn, share in _turns(pair)])


def relative_turn_with_motion(pair: Pair) -> FloatArray:
    """The same by what of the markers' own errors is a function of the motion."""
    return _of_child(pair, _turns_with_motion(pair))


def _turns_with_motion(pair: Pair) -> list[FloatArray]:
    """The covariances (k, 3, 3), rad², of the attitudes of parent, if there is one, and child, each in its axes, by
    what of their markers' own errors is a function of the motion.
    """
    return [body.attitude_noise(variance) for body, variance in _with_motion(pair)]


def _with_motion(pair: Pair) -> list[tuple[Body, float]]:
    """Parent, if there is one, and child, each with the variance of what of its markers' own errors is a function of
    the motion, m² per coordinate.
    """
    bodies = [body for body in (pair.parent, pair.child) if body is not None]
    return [(body, max(body.own_variance - float(np.mean(own_power(pair, body))), 0.0)) for body in bodies]


def of_wrong_turns(pair: Pair) -> list[FloatArray]:
    """What the two sides slide by as markers follow the motion each by itself: functions of time (n, 3, q), m, along
    the axes of parent and child, each times a unit normal number; of a room that is no body, none.

    Products of the angles are of second order in how wrong attitudes are, see `bent_slides`. The angles themselves are
    of first order, by δ × v at a lever v, and by what the mean of the markers moves.
    """
    design, wanted = pair.equations
    solved = np.linalg.lstsq(design.reshape(-1, 6), wanted.ravel(), rcond=None)[0]
    levers = np.asarray(solved.reshape(2, 3), dtype=np.float64)
    moved, turns = _with_motion(pair), np.zeros((2, 3, 3))
    room = len(turns) - len(moved)
    turns[room:] = [body.attitude_noise(variance).mean(axis=0) for body, variance in moved]
    bent = bent_slides(np.trace(turns, axis1=1, axis2=2) / 3, np.sum(levers**2, axis=1))
    angle = angles(pair.relative)
    products, angle = _of_unit_size(_products(angle)), _of_unit_size(angle - angle.mean(axis=0))
    found = [np.zeros((len(angle), 3, 0))] * room
    for (body, variance), lever, turn, of_bent in zip(moved, levers[room:], turns[room:], bent[room:], strict=True):
        arm = cross_matrices(lever[None])[0]
        of_mean = variance / float(body.weights.sum(axis=1).mean())
        variances, axes = np.linalg.eigh(arm @ turn @ arm.T + of_mean * np.eye(3))
        linear = axes * np.sqrt(np.maximum(variances, 0.0))
        both = ((angle, linear), (products, np.sqrt(of_bent) * np.eye(3)))
        found.append(np.concatenate([_along(one, np.tile(along, (len(angle), 1, 1))) for one, along in both], axis=2))
    return found


def _of_unit_size(functions: FloatArray) -> FloatArray:
    """Functions of time (n, i), times what makes the sum of their mean squares 1, unless they are 0."""
    return np.asarray(functions / np.sqrt(max(float(np.sum(np.mean(functions**2, axis=0))), 1e-300)))


def bent_slides(turned: FloatArray, squared_levers: FloatArray) -> FloatArray:
    """The variance (2,), m² per coordinate, of what of both bodies' slides is of second order in their wrong attitudes.

    Be θ the angles, and δ = K θ what a body's attitude is wrong by, of the variance s² about each axis: `turned` (2,),
    rad². At a lever v, v² in `squared_levers` (2,), m², the slide is δ × v, which is linear in θ, and ½ δ × (δ × v). As
    θ is that of wrong attitudes, too, by ε of the variance Σ s² of both bodies, it is itself in error by θ × ε / 2,
    which K turns into a slide as well. For random K, 5/6 s⁴ v² and 1/3 s² v² Σ s².
    """
    return np.asarray(squared_levers * turned * (5 / 6 * turned + turned.sum() / 3))


def _of_child(pair: Pair, turns: list[FloatArray]) -> FloatArray:
    """The covariances (k, 3, 3) of the child's attitudes against the parent's, of those of either in its axes."""
    *parent, child = turns
    R = pair.relative
    for one in parent:
        child = child + np.swapaxes(R, 1, 2) @ one @ R
    return np.asarray(child)


def _spurious(pair: Pair, in_child: bool, fit: Fit) -> FloatArray:
    """The information on (u, v), (6, 6), that the noise of attitudes seems to give in a fit in either's axes."""
    R = pair.relative
    child = relative_noise(pair, lambda share: float(np.sum(share[fit.kept] / fit.spectrum)))
    turn = (R @ child @ np.swapaxes(R, 1, 2) if in_child else child).mean(axis=0)
    own = slice(0, 3) if in_child else slice(3, 6)
    found = np.zeros((6, 6))
    found[own, own] = squared_cross(turn)
    return found


def _slide(pair: Pair, fit: Fit, found: FloatArray) -> Slide:
    """What the residuals of (u, v), found (6,), consist of."""
    power = transformed(residual_of(pair, found)) ** 2
    n = len(power)
    above = power[fit.kept[-1] + 1 :]
    white = float(np.mean(above)) if len(above) else float(fit.spectrum.min())
    ends = [(pair.child, found[3:])] + ([] if pair.parent is None else [(pair.parent, found[:3])])
    own = 0.0
    for body, lever in ends:
        turn = body.attitude_noise(body.own_variance).mean(axis=0)
        own += float(lever @ squared_cross(turn) @ lever) / 3
        own += body.own_variance / float(body.weights.sum(axis=1).mean())
    return Slide(
        white=float(np.sqrt(white)),
        correlated=float(np.sqrt(np.sum(np.maximum(fit.spectrum - white, 0)) / n)),
        locked=float(np.sqrt(np.mean(fit.locked**2))),
        of_markers=float(np.sqrt(own)),
    )
