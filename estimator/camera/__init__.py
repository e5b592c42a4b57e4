"""The camera on the chaser: its attitude over time, its place and what is uncertain about it.

`attitude` and `rig` read the two files, `camera` turns tracks from camera axes into C, and `shared` says how the errors
of the rig, which all observations share, move what is seen. Uses geometry and tables.
"""
