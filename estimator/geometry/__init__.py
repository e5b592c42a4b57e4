"""Geometry of points, rotations and symmetric matrices.

Nothing here knows of tracks, time or noise: alignment of point sets, SO(3), singular symmetric systems, gauge freedom.
Imports nothing of the estimator's other rooms.
"""
