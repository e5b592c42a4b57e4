"""One estimate from one draw's images as a line of numbers: what was tracked, errors, what is claimed."""

from functools import lru_cache

from baryscope.estimator import PathOptions, attempt
from baryscope.estimator.images import Tracked, track
from baryscope.estimator.result import Estimate
from baryscope.models.files import temporary_folder
from baryscope.study.images.scene import Scene, Setting, drawn, write_images
from baryscope.study.population.judging import measured, of_estimate
from baryscope.study.population.running import Line


@lru_cache(maxsize=1)
def prepared(seed: int, setting: Setting) -> tuple[Scene, Tracked]:
    """A draw, rendered, written as PNG files and tracked."""
    scene = drawn(seed, setting)
    with temporary_folder() as folder:
        return scene, track(*write_images(scene, folder), scene.pair, times=scene.time)


def judged(seed: int, method: str, duration: float, rate: float, width: int, noise: float) -> Line:
    """The line of a method's estimate: with the orbit, the camera's attitude and place."""
    line: Line = {"seed": seed, "method": method, "duration": duration, "rate": rate, "width": width, "noise": noise}
    scene, tracked = prepared(seed, Setting(duration, rate, width, noise))
    seen = tracked.tracks.seen
    line |= {
        "frames": len(seen),
        "features": seen.shape[1],
        "observations": int(seen.sum()),
        "pixel_noise": tracked.pixel_noise,
        "noise_ratio": tracked.noise_ratio,
    }
    with measured(line):
        found = attempt(tracked.tracks, method=method, orbit=scene.orbit, camera=scene.camera, options=PathOptions())
    if isinstance(found, Estimate):
        return line | of_estimate(found, scene.path)
    return line | {"failure": found.reason, "message": found.message}
