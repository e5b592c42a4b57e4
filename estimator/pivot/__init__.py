"""The drifting pivot: least squares of path and points with a free attitude in every frame.

`method` is the entry; drift gives a linear start, degree chooses a polynomial's, free_attitudes and refinement solve,
tie_points and lack_of_fit doubt.
Uses geometry, registration, dynamics and adjustment.
"""
