"""The noise of free attitudes as their rotation shows it, which assumes only that the body rotates smoothly.

A feature that is displaced by a few standard deviations turns a body of few features, and nothing else shows it than
the frames before and after.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, attitude_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

REACH = 6  # attitudes before and after to which a rotation is fitted
FARTHEST, LEAST_TURN = 12, 0.5  # frames to them, at most, or in slow rotations as many as turn by this, rad
MORE_NEIGHBOURS = 4  # than the degree, at least
DEGREES = 2, 4  # in time, of the rotation fitted: the next where the last does not describe it
LIMIT = 22.0  # χ² of three degrees of freedom, beyond which an attitude strays: 1 in 15,000
MEDIAN = 2.366  # of it
ROUGH = 3.0  # times the median, from which the rotation is too fast to be fitted
AROUND = 41  # attitudes whose median χ² tells how well the fits describe the rotation
ROUNDS = 4  # of the fit's robust weights


def strays(body: Body, observations: Observations, variance: float) -> BoolArray:
    """Which attitudes of a body are far from a rotation fitted to those near, (n,).

    observations (n, m), with robust weights; variance: of an observation of weight 1.
    """
    squared, tested = _departures(body, observations, variance)
    if not tested.any():
        return tested
    usual = np.maximum(np.median(squared[tested]), median_filter(squared, AROUND, mode="nearest")) / MEDIAN
    return np.asarray(tested & (squared > LIMIT * np.maximum(usual, 1.0)))


def excess_noise(body: Body, observations: Observations, variance: float) -> float:
    """The mean square of the attitudes' errors over that expected, at least 1; arguments as in `strays`.

    It is 1 where the rotation from frame to frame is too fast to be fitted.
    """
    squared, tested = _departures(body, observations, variance)
    if not tested.any() or np.median(squared[tested]) > ROUGH * MEDIAN:
        return 1.0
    return max(float(squared[tested].mean()) / 3, 1.0)


def _departures(body: Body, observations: Observations, variance: float) -> tuple[FloatArray, BoolArray]:
    """χ² (n,) of each attitude's departure from a rotation fitted to those near; and which have enough of these, (n,).

    The fit is of the lowest degree that describes most attitudes, as it has the least noise.
    """
    found = np.zeros(len(body.frames)), np.zeros(len(body.frames), dtype=bool)
    for degree in DEGREES:
        squared, tested = found = _departures_from(body, observations, variance, degree)
        if not tested.any() or np.median(squared[tested]) <= ROUGH * MEDIAN:
            break
    return found


def _departures_from(
    body: Body, observations: Observations, variance: float, degree: int
) -> tuple[FloatArray, BoolArray]:
    """Those from fits of one degree.

    The rotation vectors from the attitude to the others, less a median rate, are a polynomial in time, by robust least
    squares, whose residuals say how well.
    """
    n, size = len(body.frames), 2 * REACH + 1
    if n < size:
        return np.zeros(n), np.zeros(n, dtype=bool)
    own = observations.features(body.features).frames(body.frames)
    covariance = attitude_covariances(attitude_information(own, body.attitude, body.points), variance)
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    # Neighbours of each attitude; those beyond the ends are the attitude itself, which is not used.
    index = np.pad(np.arange(n), REACH, constant_values=-1)
    near = sliding_window_view(index, size)
    near = np.where(near < 0, np.arange(n)[:, None], near)
    apart = body.frames[near] - body.frames[:, None]
    rate = log_rotation(np.swapaxes(body.attitude[:-1], 1, 2) @ body.attitude[1:]) / np.diff(body.frames)[:, None]
    rate = median_filter(np.concatenate([rate, rate[-1:]]), (size - 2, 1), mode="nearest")
    farthest = max(FARTHEST, LEAST_TURN / max(float(np.median(np.linalg.norm(rate, axis=1))), 1e-9))
    used = (apart != 0) & (np.abs(apart) <= farthest)
    there = np.swapaxes(body.attitude, 1, 2)[:, None] @ body.attitude[near]
    there = there @ exp_rotation(-apart[:, :, None] * rate[:, None])
    turned = log_rotation(there.reshape(-1, 3, 3)).reshape(n, size, 3)
    step = apart / REACH
    terms = np.stack([step**power for power in range(degree + 1)], axis=2)
    precision = np.where(used, deviation[near] ** -2.0, 0.0)
    total = precision.sum(axis=1)[:, None, None]
    ridge = np.where(total > 0, 1e-9 * total, 1.0) * np.eye(terms.shape[2])
    weight = precision
    for _ in range(ROUNDS):
        weighted = terms * weight[:, :, None]
        inverse = np.linalg.inv(np.swapaxes(weighted, 1, 2) @ terms + ridge)
        coefficients = inverse @ (np.swapaxes(weighted, 1, 2) @ turned)
        squares = np.sum((turned - terms @ coefficients) ** 2, axis=2) * precision
        scale = np.nanmedian(np.where(used | ~used.any(axis=1)[:, None], squares, np.nan), axis=1)
        weight = precision / (1 + squares / (9 * np.maximum(scale, 1e-300))[:, None])
    fitted = inverse[:, 0, 0] / 3
    if degree > DEGREES[0]:  # at the ends it leads far off where it does not describe the rotation, as residuals show
        fitted = fitted * np.maximum(3 * np.nan_to_num(scale) / MEDIAN, 1.0)  # each square is of three axes
    expected = covariance + fitted[:, None, None] * np.eye(3)
    off = coefficients[:, 0]
    tested = used.sum(axis=1) >= degree + MORE_NEIGHBOURS
    squared = np.einsum("ki,ki->k", off, np.linalg.solve(expected, off[:, :, None])[:, :, 0])
    return np.where(tested, squared, 0.0), tested
