"""A fourth population, drawn on its own: objects that show a few features, often at one end and far from their centre.

`bodies` draws features and inertia, `timing` and `orbits` when and where the target is, `chasers` from where it is
seen, `views` which features are in view, under which labels; `relative` and `tumble` are the motion, `sensor` and
`blunders` what becomes of the observations; `cases` joins them.
"""
