"""Worlds that the models of path and tumble do not hold exactly, with an independent truth, drawn many times.

`python -m baryscope.study.world` runs them: worlds → forces → scenes → judging, and `smoother`, the peer.
"""
