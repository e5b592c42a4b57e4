"""Maximum a posteriori estimate of path, points, rate and inertia of a free tumble, starting from `pivot`.

`method` is the entry, `answer` the estimate, and `priors` says why there are some; `initial_tumble` and `nutation`
start, `maximum` iterates on the normal equations of `likelihood`, which are also those of the bound: `sums` over the
frames of a `model`, with `jacobians` of blocks of frames; `products` widen. `search` asks whether a gravity gradient
acts, `two_models` answers where that is not told; `burns` goes back to `pivot` where the tumble shows more of them.
Uses pivot and the rooms that pivot uses.
"""
