"""Tracks from images of a stereo pair, by OpenCV, which is the extra `images`: `track`.

`frames` reads pairs, by the `numbers` in their names, `rectify` aligns them, `matching` finds corners and what they
match, `patches` places them to a hundredth of a pixel, `rigid` finds what does not move with the body, `tracker` puts
these together for one pair after the other. Uses camera, geometry and tracks.
"""

from baryscope.estimator.images.track import Tracked, track

__all__ = ["Tracked", "track"]
