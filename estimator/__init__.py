"""From tracks of features to the path of the centre of mass.

tracks → intervals → procrustes (poses) → a method's screws → filtering → intersection → fit → result.
"""

from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks

__all__ = ["METHODS", "Estimate", "FeatureTracks", "ScrewOptions", "estimate"]
