"""Maximum a posteriori estimate of path, points, rate and inertia of a free tumble, from a start by `pivot`.

`method` is the entry; `likelihood` has the normal equations that the Cramér–Rao bound uses as well.
Uses pivot and what pivot uses.
"""
