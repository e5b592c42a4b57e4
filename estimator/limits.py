"""The ranges of numbers that estimators accept: wider than any mission needs, without overflow of squares or products.

Files and arrays are checked once, at the boundary: in `tables.tracks`, `tracks`, `plausibility` and `options`.
"""

FARTHEST = 1e9  # m, absolute value of a coordinate: a double resolves 0.1 µm there
LATEST = 1e10  # s, absolute value of a time, 300 years: a double resolves 2 µs there
FARTHEST_UNDER_J2 = 1e7  # s, from one time to another of the online estimator, step by step
SHORTEST_STEP = 1e-6  # s, from one frame to the next
NARROWEST = 1e-6  # m, of a body
FINEST, COARSEST = 1e-9, 1e9  # m, standard deviation of an observation along any direction
STRETCHED = 1e6  # greatest over least standard deviation of one observation: its covariance can be inverted
