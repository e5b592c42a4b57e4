"""Further unknowns of the path beside those of a solution, to first order: what tests of forces and orbits look at."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import shifts_in
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, subsampled
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.free_attitudes import linearised
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.reduced import scaled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FurtherUnknowns:
    """The problem of a solution with further unknowns, with its weights.

    path: that with them, at some frames, each with the weight of those it stands for; at (p + c,): the solution's
    unknowns, and zeros.
    """

    path: SampledPath
    linear: GaussianLikelihood
    at: FloatArray

    @classmethod
    def of(cls, found: PivotSolution, columns: Callable[[IntArray], FloatArray]) -> "FurtherUnknowns":
        """The problem of a solution; columns: indices (n,) of frames → derivatives of the path there, (n, 3, c), m."""
        few = subsampled(found.bodies, found.observations, SUBSAMPLE_FRAMES)
        observations, count = few.standing_for_all()
        added = columns(few.rows)
        path = found.sampled.frames_at(few.rows).extended(added)
        at = np.concatenate([found.solution.x, np.zeros(added.shape[2])])
        shifts = shifts_in(found.shifts, few.rows, count)
        problem = linearised(few.bodies, observations, path, at, shifts, found.offset_information)
        return cls(path, scaled(problem, found.variance), at)
