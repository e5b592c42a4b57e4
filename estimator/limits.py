"""The ranges of numbers that estimators take: wider than any mission, and such that no square or product overflows.

Files and arrays are held against them once, at the boundary: `tables.tracks`, `tracks`, `plausibility` and `options`.
"""

FARTHEST = 1e9  # m, of a coordinate, either way: there a double still tells 0.1 µm
LATEST = 1e10  # s, of a time, either way: 300 years, and a double still tells 2 µs
SHORTEST_STEP = 1e-6  # s, from one frame to the next
NARROWEST = 1e-6  # m, of a body
FINEST, COARSEST = 1e-9, 1e9  # m, standard deviation of an observation along any direction
STRETCHED = 1e6  # greatest over least standard deviation of one observation: a covariance of this still has an inverse
