"""What the filter's passes would take: too much is refused before it is begun."""

import numpy as np

from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.motion import ROTATION, STEP_ANGLE
from baryscope.estimator.ekf.start import Start
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

MAX_STEPS, STEPS_PER_FRAME = 30_000, 10  # bound of the integration steps of a pass: more would take many minutes
MAX_FEATURES = 200  # all are in the state: with as many, a frame takes seconds
MAX_MEMORY = 8e9  # bytes
MEMBERS = 20  # of a bank, about
PATH = 12  # unknowns of the path, about


def refuse_effort(start: Start, tracks: FeatureTracks) -> None:
    """Check that neither the integration of the rotation nor the size of the state makes the filter unbearably slow.

    Raises:
        ComputationError: one does.
    """
    n, m = tracks.seen.shape
    span = float(tracks.time[-1] - tracks.time[start.frame])
    speed = float(np.hypot(np.linalg.norm(start.rate), start.rate_deviation))
    if speed * span > STEP_ANGLE * (MAX_STEPS + STEPS_PER_FRAME * n):
        raise too_long(speed, span)
    # Each member's innovations and predictions, and three matrices of the state a frame for the smoother.
    memory = 8.0 * n * (4 * MEMBERS * m + 3 * (PATH + ROTATION + 3 * m) ** 2)
    if m > MAX_FEATURES or memory > MAX_MEMORY:
        raise ComputationError(
            f"{counted(n, 'frame')} of {counted(m, 'feature')}: a filter of so many would take hours or "
            f"{memory / 1e9:.2g} GB; use at most {MAX_FEATURES} features and fewer frames, or the method pivot",
            Reason.TOO_LARGE,
        )
