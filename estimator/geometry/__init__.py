"""Geometry of points, rotations and symmetric matrices.

Alignment of point sets, SO(3), singular symmetric systems, gauge freedom; nothing depends on tracks, time or noise.
Imports nothing of the estimator's other rooms.
"""
