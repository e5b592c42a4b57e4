"""Lag and cut-off of the screw methods, chosen from the registered motion if the user gives none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import LOWEST_CUTOFF
from baryscope.estimator.screws.motion import Pairs, RegisteredMotion, pairs_of, step_of
from baryscope.estimator.screws.screws import Screws, screws_of_poses
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]

MAX_ANGLE = np.deg2rad(100.0)  # larger rotations reduce the noise little, and have more bias (θ/2)/sin(θ/2)
SAMPLES = 1500  # pairs examined for each lag
BLOCKS = 50  # of the time span, to measure how much of it the intersections cover
MIN_COVERAGE = 0.9  # of the best lag's coverage
NOISE_MARGIN = 4.0  # times the variance of the angle between axes, subtracted from its square
CUTOFF_RATIO = 8.0  # cut-off frequency over the rate of rotation in turns per second


@dataclass(frozen=True)
class Trial:
    """Quality of a lag: median screw angle in rad, information of the intersections, number of covered blocks."""

    lag: int
    angle: float
    information: float
    covered: int


def choose_lag(motion: RegisteredMotion) -> Trial:
    """The lag in frames whose intersections have the most information: the sum of sin²(θ/2) sin²ψ over them.

    θ is the angle of a screw and ψ the angle between the two axes: the error of an axis is proportional to
    1/(2 sin(θ/2)), that of the midpoint along the axes to 1/sin ψ times it. Longer lags improve both, but leave fewer
    pairs in an interval, and none in short intervals. So only lags are considered that cover nearly as much of the time
    as the best one, as no polynomial bridges a third of an orbit.

    Raises:
        ComputationError: no interval is long enough for two screws in a row.
    """
    longest = max(interval.length for interval in motion.intervals)
    if longest < 3:
        raise ComputationError(
            "the longest interval in which the same features are followed has "
            f"{counted(longest, 'frame')}, at least 3 are needed",
            Reason.SHORT_INTERVALS,
        )
    trials: list[Trial] = []
    lag = 1
    while 2 * lag < longest:
        trials.append(try_lag(motion, lag))
        if trials[-1].angle > MAX_ANGLE and len(trials) > 1:
            trials.pop()
            break
        lag = max(lag + 1, int(lag * 1.2))
    required = MIN_COVERAGE * max(trial.covered for trial in trials)
    covering = [trial for trial in trials if trial.covered >= required]
    return max(covering, key=lambda trial: (trial.information, trial.angle))


def try_lag(motion: RegisteredMotion, lag: int) -> Trial:
    """The quality of a lag in frames, from a sample of its screws."""
    pairs = pairs_of(motion, lag)
    successors = np.searchsorted(pairs.first, pairs.second)
    has_next = successors < len(pairs.first)
    has_next[has_next] = pairs.first[successors[has_next]] == pairs.second[has_next]
    chosen = np.nonzero(has_next)[0]
    if not chosen.size:
        return Trial(lag, 0.0, 0.0, 0)
    every = max(1, len(chosen) // SAMPLES)
    sample = chosen[::every]
    one, two = (_pose_screws(pairs, index) for index in (sample, successors[sample]))
    valid = one.valid & two.valid
    if not valid.any():
        return Trial(lag, 0.0, 0.0, 0)
    square = np.linalg.norm(np.cross(one.axis[valid], two.axis[valid]), axis=1) ** 2
    half = np.sin(one.angle[valid] / 2) ** 2
    middle = motion.time[pairs.second[chosen]]
    edges = np.linspace(motion.time[0], motion.time[-1], BLOCKS + 1)[1:-1]
    covered = len(np.unique(np.searchsorted(edges, middle)))
    noise = pairs.angle_deviation[sample][valid] ** 2 / half  # of the angle between two axes, both directions
    information = float(np.sum(half * (square - NOISE_MARGIN * noise)))
    return Trial(lag, float(np.median(one.angle[valid])), max(0.0, information) * every, covered)


def _pose_screws(pairs: Pairs, index: NDArray[np.intp]) -> Screws:
    motion, first, second = pairs.motion, pairs.first[index], pairs.second[index]
    return screws_of_poses(motion.rotation[first], motion.centre[first], motion.rotation[second], motion.centre[second])


def choose_cutoff(motion: RegisteredMotion, trial: Trial) -> float:
    """Cut-off in Hz: a few times the rate of rotation, above the frequencies of a tumbling axis."""
    rate = trial.angle / (trial.lag * step_of(motion))
    return max(float(CUTOFF_RATIO * rate / (2 * np.pi)), LOWEST_CUTOFF) if rate > 0 else np.inf
