"""The drifting pivot: least squares of path and points with a free attitude in every frame.

`method` is the entry: `start` (from the linear `drift`) gives an `initial_solution`, from which `refinement` iterates
over `free_attitudes` (by `elimination`); then `strays`, `burns` that nothing told, `unexplained` orbits, `tie_points`
and `lack_of_fit`. `answer` is the estimate of a `pivot_solution`, with the `joint_covariance`, and the `ridge` of what
is hardly observable.
Uses geometry, registration, paths, dynamics, result and adjustment.
"""
