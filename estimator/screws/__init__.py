"""The published method and its baselines: screw axes, their pseudo-intersections, low-pass and polynomial.

`pipeline` is what they share; `raw`, `gpa` and `least_squares` find the screws.
Uses geometry and registration.
"""
