"""What the refinement begins from: bodies and a path near the solution, and what else is known before it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class InitialSolution:
    """The initial solution of the refinement.

    path, and sampled at the tracks' times (n,) in s; registered: the bodies, with points from their centroid; bodies
    with points from the centre of mass, and the path's x; measured: all observations; observations: those of bodies in
    their frames; inliers (n, m): which passed screening; weight (n, m): of the observations in this solution, if not
    their own. lasting: how many frames have the same errors of the features, as the registered bodies tell; variance:
    of an observation of weight 1, as these tell; errors: of the camera at the times; first_prior: of a simple path,
    which holds until the weights have settled; slips: whether the position may have white noise, as that of a pivot
    that slips, or of a camera that shakes; slip: its variance, m², if that is given.
    """

    path: Path
    sampled: SampledPath
    time: FloatArray
    registered: tuple[Body, ...]
    bodies: tuple[Body, ...]
    x: FloatArray
    measured: Observations
    observations: Observations
    inliers: BoolArray
    weight: FloatArray | None = None
    lasting: float = 1.0
    variance: float = 0.0
    errors: SharedErrors | None = None
    first_prior: Prior | None = None
    slips: bool = False
    slip: float = 0.0

    def on(self, path: Path, sampled: SampledPath, x: FloatArray) -> "InitialSolution":
        """The start on another path, sampled at the times, with unknowns x (p,) that are good enough for its prior."""
        return replace(self, path=path, sampled=sampled, x=x, first_prior=None)

    def near(self, found: PivotSolution) -> "InitialSolution":
        """The start with the bodies of a solution, and the weights that it has found."""
        return replace(self, bodies=found.bodies, observations=found.observations, inliers=found.inliers, weight=None)
