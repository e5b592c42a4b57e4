"""Unknown burns once more, by the attitudes of a tumble.

A rig at a distance hardly knows depths, and so hardly the attitude of a frame by itself: what burns do to the path is
lost in what its errors do to the offset. All frames together know the attitudes of a tumble well.
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.dynamics.process_noise import DENSITY
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.ml.iteration import turned_by
from baryscope.estimator.ml.maximum import MaximumAPosteriori
from baryscope.estimator.pivot.burns.poses import KnownPoses
from baryscope.estimator.pivot.burns.solution import may_have_burns
from baryscope.estimator.pivot.found import Pivot
from baryscope.estimator.pivot.method import PivotProblem


def with_burns_of_tumble(problem: PivotProblem, pivot: Pivot, best: MaximumAPosteriori) -> PivotProblem | None:
    """The problem of `pivot` solved with the burns that a tumble shows; None without any.

    pivot: its solution with a column for each point, from which the maximum of the likelihood is reached. Only where
    that solution leaves something to process noise.
    """
    if not (best.converged and may_have_burns(problem.start.path, problem.options) and problem.solved.has(DENSITY)):
        return None
    turned, attitude = turned_by(best.sampled, best.x), best.motion.attitude
    seen = attitude if turned is None else exp_rotation(turned) @ attitude
    weight, bodies = np.zeros_like(problem.start.measured.weight), []
    for own, columns in zip(problem.solved.bodies, (body.features for body in pivot.bodies), strict=True):
        points = best.equations.points[columns]
        bodies.append(replace(own, points=points, attitude=seen[own.frames]))
        weight[np.ix_(own.frames, own.features)] = best.observations.weight[np.ix_(own.frames, columns)]
    observations, origin = problem.start.measured.weighted(weight), best.sampled.position(best.x)
    posed = KnownPoses.of(tuple(bodies), observations, origin, best.residual_variance)
    return problem.with_burns_by(posed)
