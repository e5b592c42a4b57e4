"""Unknown burns once more, by the attitudes of a tumble.

A rig at a distance hardly knows depths, and so hardly the attitude of a frame by itself: what burns do to the path is
lost in what its errors do to the offset. All frames together know the attitudes of a tumble well.
"""

import numpy as np

from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.ml.iteration import turned_by
from baryscope.estimator.ml.maximum import MaximumAPosteriori
from baryscope.estimator.pivot.method import PivotProblem
from baryscope.estimator.pivot.pivot_solution import PivotSolution


def with_burns_of_tumble(problem: PivotProblem, pivot: PivotSolution, best: MaximumAPosteriori) -> PivotProblem | None:
    """The problem of `pivot` solved with the burns that a tumble shows; None without any.

    pivot: its solution with a column for each point, from which the maximum of the likelihood is reached.
    """
    if not best.converged:
        return None
    turned, attitude = turned_by(best.sampled, best.x), best.motion.attitude
    seen = attitude if turned is None else exp_rotation(turned) @ attitude
    weight, points = np.zeros_like(problem.start.measured.weight), []
    for own, columns in zip(problem.solved.bodies, (body.features for body in pivot.bodies), strict=True):
        points.append(best.seen_points[columns])
        weight[own.block] = best.observations.weight[np.ix_(own.frames, columns)]
    return problem.with_burns_of(points, seen, best.sampled.position(best.x), weight, best.residual_variance)
