"""From a solution of `pivot` to the tumble of greatest likelihood."""

import numpy as np

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance
from baryscope.estimator.ml.initial_tumble import fit_tumble
from baryscope.estimator.ml.maximum import ROUNDING, STAGE, Likelihood, maximised
from baryscope.estimator.ml.relabelling import relabelled
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.found import Pivot
from baryscope.estimator.progress import Rounds
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit


def likeliest_tumble(
    tracks: FeatureTracks, solved: Pivot, torques: tuple[Orbit | None, ...], options: PathOptions, done: Rounds
) -> tuple[FeatureTracks, Pivot, Likelihood]:
    """The maximum of the likelihood, and tracks and solution of `pivot` with a column for each point, if labels do not.

    torques: the orbits whose gravity gradient may act, None for none.

    Raises:
        ComputationError: no tumble is found.
    """
    tracks, pivot = relabelled(tracks, solved)
    noise = max(pivot.frame_variance, least_variance(pivot.observations, ROUNDING))
    tumble = fit_tumble(pivot.bodies, pivot.observations, noise, tracks.time, torques)
    done.did(STAGE)
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            best = maximised(tracks, pivot, tumble, options, done)
        finite = bool(np.isfinite(best.found.cost) and np.isfinite(best.posterior.covariance).all())
    except np.linalg.LinAlgError:
        finite = False
    if not finite:
        raise ComputationError("no rotation with a torque follows the attitudes over the whole time", Reason.DIVERGED)
    return tracks, pivot, best
