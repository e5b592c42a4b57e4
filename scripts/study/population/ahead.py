"""Predictions of a case, judged by its truth carried on: of the centre of mass and of a feature, in position and
velocity, in the middle of the longest gap, a quarter of the tracks' span after their end, and one span after it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import Estimate
from baryscope.models.errors import ComputationError, InputError
from baryscope.study.population.consistency import limit, nees
from baryscope.study.population.interface import Drawn, Sample, Truth
from baryscope.study.population.running import Line

FloatArray = NDArray[np.float64]

WHEN = ("gap", "quarter", "span")
CENTRE, FEATURE = "centre", "feature"
WRONG = limit(6)  # of position and velocity


@dataclass(frozen=True, eq=False)
class Asked:
    """What every estimate of a case is asked: at which times (3,) in s, see WHEN, where a point (3,) in B, m, of a
    label will be, besides the centre of mass; truth: the motion then.
    """

    time: FloatArray
    label: str
    point: FloatArray
    truth: Truth


def asked_of(case: Drawn, sample: Sample) -> Asked:
    """The point is the feature of most right observations; a gap is a time without any observation."""
    seen = case.time[sample.tracks.seen.any(axis=1)]
    first = int(np.argmax(np.diff(seen)))
    begin, end = float(case.time[0]), float(case.time[-1])
    time = np.array([seen[first : first + 2].mean(), end + (end - begin) / 4, end + (end - begin)])
    feature = int(sample.right.sum(axis=0).argmax())
    return Asked(time, sample.tracks.labels[feature], case.points[feature], case.at(time))


def predicted(found: Estimate, asked: Asked) -> Line:
    """What an estimate predicts, by "point when": the error of position and what is claimed of it, m, and the NEES of
    position and velocity. Of a point that it does not predict, by "point": why.
    """
    line: Line = {}
    for name, point, place in ((CENTRE, None, np.zeros(3)), (FEATURE, asked.label, asked.point)):
        try:
            there = found.predict(asked.time, point)
        except (ComputationError, InputError) as refusal:
            line[name] = str(refusal)
            continue
        error = np.concatenate([there.position, there.velocity], axis=1) - asked.truth.state(place)
        for k, when in enumerate(WHEN):
            line[f"{name} {when}"] = {
                "error": float(np.linalg.norm(error[k, :3])),
                "claimed": float(np.sqrt(np.trace(there.covariance[k, :3, :3]))),
                "nees": nees(error[k], there.covariance[k]),
            }
    return line


def missed(one: Line) -> bool:
    """Whether the errors of a prediction are beyond its covariance, with p < 0.001."""
    return not one["nees"] <= WRONG


def misses(line: Line) -> list[str]:
    """The predictions of a line that are wrong, as "point when"."""
    made = line.get("predicted", {})
    return [name for name, one in made.items() if not isinstance(one, str) and missed(one)]
