"""The sensor: noise of its own or of a rig whose depth is worse, gross outliers, and labels that change places."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import log_uniform, unit

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Sensor:
    """noise: standard deviation of a coordinate, or of the depth at the median range, m; ratio: of a rig, depth over
    lateral there, 0 without a rig; told: whether the estimator is told the noise; outliers: share of observations;
    kind: gross, swap or both; least, most: size of gross ones, m.
    """

    noise: float
    ratio: float = 0.0
    told: bool = False
    outliers: float = 0.0
    kind: str = ""
    least: float = 0.0
    most: float = 0.0

    @property
    def words(self) -> str:
        """How it was drawn."""
        text = f"{self.noise * 1e3:.1f}mm"
        if self.ratio:
            text = f"stereo {text} depth 1:{self.ratio:.0f}"
        text += " told" if self.told else ""
        return text + (f", {self.outliers:.1%} {self.kind} outliers" if self.kind else "")


@dataclass(frozen=True, eq=False)
class Observations:
    """position (n, m, 3) in C, m, NaN where nothing is seen; covariance (n, m, 3, 3) in C as the estimator gets it, or
    none; precision (n, m, 3, 3): the true inverse covariance of the noise, 1/m²; right (n, m): not gross nor swapped.
    """

    position: FloatArray
    covariance: FloatArray | None
    precision: FloatArray
    right: BoolArray

    def within(self, frames: BoolArray, labels: BoolArray) -> "Observations":
        """Those of some frames (n,) and labels (m,)."""
        covariance = None if self.covariance is None else self.covariance[frames][:, labels]
        position, precision = self.position[frames][:, labels], self.precision[frames][:, labels]
        return Observations(position, covariance, precision, self.right[frames][:, labels])


def draw_sensor(
    rng: np.random.Generator, true: FloatArray, radius: float, size: float, clean: bool
) -> tuple[Sensor, Observations]:
    """A sensor, and what it makes of the true places (n, m, 3) in C, NaN where nothing is seen.

    radius: of the features, size: of the body, m; clean: 0.1 µm of noise and no outliers.
    """
    stereo = rng.random() < 0.35
    while True:
        level = float(np.clip(np.exp(rng.normal(np.log(0.012), 1.2)), 0.001, 0.2))
        if level < 0.3 * radius or rng.random() < 0.1:
            break
    if clean:
        stereo, level = False, 1e-7
    ratio = rng.uniform(2, 25) if stereo else 0.0
    white = rng.standard_normal(true.shape)
    told = rng.random() < 0.25
    outliers, kind = 0.0, ""
    if rng.random() < 1 / 3 and not clean:
        outliers = rng.uniform(0.002, 0.2) if rng.random() < 0.6 else log_uniform(rng, 0.001, 0.05)
        kind = str(rng.choice(["gross", "swap", "both"]))
    sensor = Sensor(level, ratio, told, outliers, kind, 0.1 * size + 4 * level, 1.5 * size + 8 * level)
    return sensor, _observed(rng, sensor, true, white)


def observed(rng: np.random.Generator, sensor: Sensor, true: FloatArray) -> Observations:
    """What that sensor makes of the true places (n, m, 3) in C another time."""
    return _observed(rng, sensor, true, rng.standard_normal(true.shape))


def _observed(rng: np.random.Generator, sensor: Sensor, true: FloatArray, white: FloatArray) -> Observations:
    seen = np.isfinite(true[..., 0])
    if sensor.ratio:
        noise, covariance = _rig(sensor, true, white)
        precision = np.linalg.inv(np.where(seen[..., None, None], covariance, np.eye(3)))
    else:
        noise, covariance = sensor.noise * white, None
        precision = np.broadcast_to(np.eye(3) / sensor.noise**2, (*seen.shape, 3, 3))
    position = true + noise
    right = seen & ~_gross(rng, sensor, position, seen)
    if sensor.kind in ("swap", "both"):
        for k, one, other in _swaps(rng, seen, _share(sensor)):
            position[k, [one, other]] = position[k, [other, one]]
            if covariance is not None:
                covariance[k, [one, other]] = covariance[k, [other, one]]
            right[k, [one, other]] = False
    return Observations(position, covariance, precision, right)


def _rig(sensor: Sensor, true: FloatArray, white: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Noise (n, m, 3) and its covariance (n, m, 3, 3): across the ray it grows as the range, along it as its square."""
    depth = np.linalg.norm(true, axis=-1)
    middle = np.nanmedian(depth) if np.isfinite(depth).any() else 1.0
    ray = true / depth[..., None]
    across = sensor.noise / sensor.ratio * depth / middle
    along = sensor.noise * (depth / middle) ** 2
    outer = ray[..., :, None] * ray[..., None, :]
    covariance = across[..., None, None] ** 2 * (np.eye(3) - outer) + along[..., None, None] ** 2 * outer
    inward = (white * ray).sum(-1, keepdims=True) * ray
    noise = across[..., None] * (white - inward) + along[..., None] * inward
    return noise, (covariance + np.swapaxes(covariance, -1, -2)) / 2


def _share(sensor: Sensor) -> float:
    return sensor.outliers / (2 if sensor.kind == "both" else 1)


def _gross(rng: np.random.Generator, sensor: Sensor, position: FloatArray, seen: BoolArray) -> BoolArray:
    """Displaces some of what is seen (n, m), and says which."""
    if sensor.kind not in ("gross", "both"):
        return np.zeros_like(seen)
    wrong = seen & (rng.random(seen.shape) < _share(sensor))
    count = int(wrong.sum())
    far = np.exp(rng.uniform(np.log(sensor.least), np.log(sensor.most), count))
    position[wrong] += unit(rng, count) * far[:, None]
    return wrong


def _swaps(rng: np.random.Generator, seen: BoolArray, share: float) -> list[tuple[int, int, int]]:
    """Frames, and two labels of each that change places in it."""
    found = []
    for k in range(len(seen)):
        there = np.flatnonzero(seen[k])
        pairs = rng.binomial(len(there) // 2, min(share, 1.0))
        chosen = rng.permutation(there)[: 2 * pairs].reshape(-1, 2)
        found += [(k, int(one), int(other)) for one, other in chosen]
    return found
