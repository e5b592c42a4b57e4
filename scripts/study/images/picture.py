"""What the left camera saw last, with the features that are followed and where they were in the frames before."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.images import Tracked
from baryscope.study.images.render import projected
from baryscope.study.images.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 100  # so that a pixel of the image is one of the picture
FOLLOWED, FEW = "#ffb000", 2.5  # colour, and size of a feature, points


def trails(scene: Scene, tracked: Tracked) -> NDArray[np.float64]:
    """Pixels (n, m, 2) of the tracked points in the left image as it is taken; NaN where there is none."""
    seen = tracked.tracks.seen
    found = np.full((*seen.shape, 2), np.nan)
    found[seen] = projected(scene.pair.left, tracked.tracks.position[seen])
    return found


def picture(scene: Scene, tracked: Tracked) -> "Figure":
    """The last left image, in its own size."""
    from matplotlib.figure import Figure

    *_, (left, _) = scene.images()
    height, width = left.shape
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    panel = figure.add_axes((0, 0, 1, 1))
    panel.imshow(left, cmap="gray", vmin=0, vmax=255)
    places = trails(scene, tracked)
    now = tracked.tracks.seen[-1]
    panel.plot(*places[:, now].transpose(2, 0, 1), color=FOLLOWED, linewidth=0.8, alpha=0.7)
    panel.plot(*places[-1, now].T, "o", color=FOLLOWED, markersize=FEW)
    panel.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    panel.set_axis_off()
    return figure
