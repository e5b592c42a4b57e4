"""Lag and cut-off of the screw methods, chosen from the registered motion where the user leaves them open."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import LOWEST_CUTOFF
from baryscope.estimator.screws.motion import Pairs, RegisteredMotion, pairs_of, step_of
from baryscope.estimator.screws.screws import Screws, screws_of_poses
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]

WIDEST = np.deg2rad(100.0)  # a longer turn gives little less noise, and more bias (θ/2)/sin(θ/2)
SAMPLES = 1500  # pairs looked at for each lag that is tried
STRETCHES = 50  # of the whole time, to tell how much of it intersections cover
ALIKE = 0.9  # of the stretches that the best lag covers
NOISE_SHARE = 4.0  # times the noise, as a square, that does not count as a turn of the axis
CUTOFF_RATIO = 8.0  # cut-off frequency over the rate of rotation in turns per second


@dataclass(frozen=True)
class Trial:
    """What a lag promises: median angle of the screws in rad, information in the intersections, stretches covered."""

    lag: int
    angle: float
    information: float
    covered: int


def choose_lag(motion: RegisteredMotion) -> Trial:
    """The lag in frames whose intersections are worth most: the sum of sin²(θ/2) sin²ψ over them.

    θ is the angle of a screw and ψ the angle between the two axes: an axis is known to 1/(2 sin(θ/2)), and the midpoint
    along the axes 1/sin ψ worse. Longer lags improve both, but leave fewer pairs in an interval, and short intervals
    none. So only lags count that cover nearly as much of the time as any: no polynomial bridges a third of an orbit.

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
        if trials[-1].angle > WIDEST and len(trials) > 1:
            trials.pop()
            break
        lag = max(lag + 1, int(lag * 1.2))
    wanted = ALIKE * max(trial.covered for trial in trials)
    covering = [trial for trial in trials if trial.covered >= wanted]
    return max(covering, key=lambda trial: (trial.information, trial.angle))


def try_lag(motion: RegisteredMotion, lag: int) -> Trial:
    """Angle and information of the screws of one lag, from a sample of them."""
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
    good = one.valid & two.valid
    if not good.any():
        return Trial(lag, 0.0, 0.0, 0)
    square = np.linalg.norm(np.cross(one.axis[good], two.axis[good]), axis=1) ** 2
    half = np.sin(one.angle[good] / 2) ** 2
    middle = motion.time[pairs.second[chosen]]
    edges = np.linspace(motion.time[0], motion.time[-1], STRETCHES + 1)[1:-1]
    covered = len(np.unique(np.searchsorted(edges, middle)))
    noise = pairs.angle_deviation[sample][good] ** 2 / half  # of the angle between two axes, both directions
    worth = float(np.sum(half * (square - NOISE_SHARE * noise)))
    return Trial(lag, float(np.median(one.angle[good])), max(0.0, worth) * every, covered)


def _pose_screws(pairs: Pairs, index: NDArray[np.intp]) -> Screws:
    motion, first, second = pairs.motion, pairs.first[index], pairs.second[index]
    return screws_of_poses(motion.rotation[first], motion.centre[first], motion.rotation[second], motion.centre[second])


def choose_cutoff(motion: RegisteredMotion, trial: Trial) -> float:
    """Cut-off in Hz: a few times the rate of rotation, above all that a tumbling axis does in a turn."""
    rate = trial.angle / (trial.lag * step_of(motion))
    return max(float(CUTOFF_RATIO * rate / (2 * np.pi)), LOWEST_CUTOFF) if rate > 0 else np.inf
