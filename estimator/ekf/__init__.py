"""An iterated extended Kalman filter with smoother, after Segal, Carmi and Gurfil (2014), for comparison.

`method` is the entry; `start` registers all frames; `passes` linearises (`linearised`, `motion`, `camera`), chooses
densities of process noise (`bank`), filters and smooths (`filter`, `solution`, `smoothness`); `spurious` and `products`
widen; `prediction` smooths at other times, with `further_nodes`. Uses geometry, registration, paths, dynamics,
adjustment, pivot, the fitted tumble and the frame noise of ml, and result.
"""
