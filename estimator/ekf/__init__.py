"""An iterated extended Kalman filter with smoother, after Segal, Carmi and Gurfil (2014), for comparison.

`method` is the entry; a bank of filters chooses the process noise; passes start from the result of the one before.
Uses geometry, registration, dynamics, result and adjustment.
"""

from baryscope.estimator.ekf.method import estimate_by_filter

__all__ = ["estimate_by_filter"]
