"""From tracks of features to the path of the centre of mass.

screws: tracks → intervals → procrustes (poses) → a method's screws → filtering → intersection → fit → result.
pivot: tracks → robust (screen) → bodies (poses) → drift (linear) → bundle (refined) → assessment → result.
ml: pivot → tumble (rate, inertia) → likelihood (everything at once) → assessment → result.
ekf: tracks → start → passes of a bank of filters → smoother → assessment → result.
score: tracks → bodies → least squares of a fixed centre → assessment → result.
"""

from baryscope.estimator.document import write_estimate
from baryscope.estimator.methods import METHODS, Failure, attempt, estimate
from baryscope.estimator.options import PathOptions, ScrewOptions
from baryscope.estimator.result import Estimate, Status
from baryscope.estimator.tracks import FeatureTracks

__all__ = [
    "METHODS",
    "Estimate",
    "Failure",
    "FeatureTracks",
    "PathOptions",
    "ScrewOptions",
    "Status",
    "attempt",
    "estimate",
    "write_estimate",
]
