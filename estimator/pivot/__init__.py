"""The drifting pivot: least squares of path and points with a free attitude in every frame.

`method` is the entry: drift (linear start), refinement of free_attitudes, tie_points, lack_of_fit.
Uses geometry, registration, dynamics, result and adjustment.
"""

from baryscope.estimator.pivot.method import MAX_VARIANCE_RATIO, estimate_by_pivot, solve_pivot
from baryscope.estimator.pivot.refinement import Pivot, least_variance

__all__ = [
    "MAX_VARIANCE_RATIO",
    "Pivot",
    "estimate_by_pivot",
    "least_variance",
    "solve_pivot",
]
