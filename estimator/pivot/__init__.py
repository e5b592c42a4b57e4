"""The drifting pivot: least squares of path and points with a free attitude in every frame.

`method` is the entry: drift (linear start), degree, refinement of free_attitudes, tie_points, lack_of_fit.
Uses geometry, registration, dynamics, result and adjustment.
"""

from baryscope.estimator.pivot.method import estimate_by_pivot, solve_pivot
from baryscope.estimator.pivot.refinement import Pivot

__all__ = ["Pivot", "estimate_by_pivot", "solve_pivot"]
