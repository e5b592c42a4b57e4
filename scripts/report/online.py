"""What a report shows of the online estimate of its tracks, whatever made the estimate that it is of."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.limits import FINEST
from baryscope.estimator.online import OnlineEstimator
from baryscope.estimator.online.course import OnlineCourse, course_of, mean_pushes
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.orbit import Orbit
from baryscope.report.charts import convergence_chart
from baryscope.report.document import Chart

FloatArray = NDArray[np.float64]

MOST_FRAMES = 20_000  # which take some seconds


def online_course(
    tracks: FeatureTracks, orbit: Orbit | None, sigma: float, thrust: KnownAcceleration | None = None
) -> OnlineCourse | str:
    """What the online estimator tells of tracks frame by frame, or why it tells nothing.

    Args:
        tracks: in C.
        orbit: of the target, if it is known.
        sigma: deviation of a coordinate in m, where the tracks have no covariances.
        thrust: of the chaser, as it is logged.
    """
    if len(tracks.time) > MOST_FRAMES:
        return f"{len(tracks.time)} frames are more than the {MOST_FRAMES} that a report has it for"
    noise = 0.0 if tracks.camera is None else float(np.max(tracks.camera.rig.attitude_noise))
    try:
        filter = OnlineEstimator(max(sigma, FINEST), orbit, attitude_noise=noise)
        pushes = None if thrust is None else mean_pushes(thrust, tracks.time, orbit)
        return course_of(filter, tracks.time, tracks.position, tracks.covariance, pushes)
    except (ComputationError, InputError) as reason:  # there may be no compiler, and it refuses longer gaps
        return str(reason)


def course_chart(course: OnlineCourse, path: FloatArray, of: str, **how: Any) -> Chart:
    """How the online estimate converges to a path (n, 3); of: what that is."""
    flags = {"tracking": course.tracking, "tumble known": course.tumble}
    marks = tuple((float(course.time[np.argmax(one)]), word) for word, one in flags.items() if one.any())
    error = np.linalg.norm(course.position - path, axis=1)
    return convergence_chart(f"distance from {of}", course.time, error, course.covariance, marks=marks, **how)
