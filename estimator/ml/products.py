"""What products of errors do to the estimate of `ml`, see `adjustment.products`."""

import numpy as np

from baryscope.estimator.adjustment.products import are_negligible, independent, product_shifts
from baryscope.estimator.ml.iteration import turned_by
from baryscope.estimator.ml.jacobians import Jacobians
from baryscope.estimator.ml.likelihood import equations
from baryscope.estimator.ml.maximum import MaximumAPosteriori
from baryscope.estimator.ml.model import Model
from baryscope.estimator.tracks import FloatArray


def product_errors(
    best: MaximumAPosteriori, turn: Jacobians, y: FloatArray, spread: FloatArray, offset: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors (q, k) of y and (3 m, k) of the points, in SI units, by k independent causes of variance 1.

    There are none where they are negligible.

    Args:
        best: the maximum.
        turn: the Jacobian of the attitude, as a rotation vector in C, by the rotation's unknowns.
        y: covariance (q, q) of the unknowns.
        spread: covariances (n, 3, 3) in B of the attitude errors that it makes, less their mean, rad².
        offset: covariance (3, 3) in B of the centre of mass from the features, m².
    """
    size, R, path = best.rotation.size, best.motion.attitude, best.sampled
    position, none = (
        path.covariance(y[size:, size:]),
        (np.zeros((len(y), 0)), np.zeros((best.equations.points.size, 0))),
    )
    if are_negligible(spread, offset, position):
        return none
    turns = np.swapaxes(R, 1, 2) @ turn.times(independent(y[:size, :size])[0])
    shift = R @ product_shifts(turns, offset, position)
    if not shift.shape[2]:
        return none
    origin, turned = path.position(best.x), turned_by(path, best.x)
    # A pattern is one more unknown of the path, which the equations have beside the others.
    model = Model(best.motion, path.extended(shift), origin, best.seen_points, best.noise, None, turned)
    found, q = equations(best.observations, model), len(y)
    of_y = y @ found.matrix[:q, q:] / max(best.variance, 1e-300)
    return of_y, found.by_unknowns[:, q:] - found.by_unknowns[:, :q] @ of_y
