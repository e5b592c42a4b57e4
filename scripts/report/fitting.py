"""Parts of a report made lighter until they fit into the room that a page has left for them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.report.document import Chart, Part, Scene, Series, Tabs
from baryscope.report.gaps import gaps_of
from baryscope.report.page import weight_of
from baryscope.report.thinning import evenly, extremes

FloatArray = NDArray[np.float64]

LEAST_FRAMES = 60  # of a scene
LEAST_POINTS = 80  # of a curve
ASIDE = 0.95  # of the room, that the next round aims at
SLOWEST = 0.98  # of the weight before, below which there is more to leave out


def fitted(parts: tuple[Part, ...], room: int) -> tuple[tuple[Part, ...], int]:
    """The parts with so much of their curves, points and frames as fits into so many bytes, and how many these are.

    They are more than the room if not even the least that is shown of the parts fits.
    """
    share, before = 1.0, float("inf")
    while True:
        lighter = thinned(parts, share)
        weight = weight_of(lighter)
        if weight <= room or weight > SLOWEST * before:
            return lighter, weight
        share, before = share * ASIDE * room / weight, weight


def thinned(parts: tuple[Part, ...], share: float) -> tuple[Part, ...]:
    """The parts with a share of their curves' points and scenes' frames, but enough of each that it is still one."""
    return tuple(_thinned(part, share) for part in parts)


def _thinned(part: Part, share: float) -> Part:
    if isinstance(part, Tabs):
        return replace(part, choices=tuple((name, thinned(inner, share)) for name, inner in part.choices))
    if isinstance(part, Chart):
        return replace(part, series=tuple(_fewer_points(one, share) for one in part.series))
    return _fewer_frames(part, share) if isinstance(part, Scene) else part


def _fewer_points(series: Series, share: float) -> Series:
    count = len(series.x)
    most = max(LEAST_POINTS, int(share * count))
    if count <= most:
        return series
    single = series.style in ("points", "cross")
    keep = evenly(count, most) if single else extremes(series.y, most)
    return replace(
        series,
        x=series.x[keep],
        y=series.y[keep],
        low=None if series.low is None else series.low[keep],
        high=None if series.high is None else series.high[keep],
        of=None if series.of is None else series.of[keep],
        total=(series.total or count) if single else series.total,
    )


def _fewer_frames(scene: Scene, share: float) -> Scene:
    count = len(scene.time)
    keep = evenly(count, max(LEAST_FRAMES, int(share * count)))
    if len(keep) == count:
        return scene

    def kept(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else values[keep]

    ghosts = (replace(one, offset=one.offset[keep], covariance=kept(one.covariance)) for one in scene.ghosts)
    return replace(
        scene,
        time=scene.time[keep],
        path=scene.path[keep],
        features=scene.features[keep],
        state=tuple(scene.state[index] for index in keep.tolist()),
        ghosts=tuple(ghosts),
        attitude=kept(scene.attitude),
        orbit=kept(scene.orbit),
        every=scene.every * count / len(keep),
        gaps=tuple(gaps_of(scene.time[keep]).tolist()),
    )
