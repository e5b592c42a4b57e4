"""The noise of a sensor: its kinds, and draws of it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from baryscope.study.population.interface import BoolArray, FloatArray
from baryscope.study.population.third.dice import log_uniform
from baryscope.study.population.third.mismatches import RIG, UNTOLD_RIG, Plan

LEAST_COSINE = 0.15  # of the view angle, below which noise grows no more
JITTER = (1e-4, 5e-3)  # s


@dataclass(frozen=True, eq=False)
class Watch:
    """What is to be seen, in n frames under m labels.

    ideal (n, m, 3) and velocity (n, m, 3): of the features in C, m and m/s; attitude (n, 3, 3) R_C_B; path (n, 3) in C;
    facing (n, m): cosines of the view angles; seen (n, m).
    """

    ideal: FloatArray
    velocity: FloatArray
    attitude: FloatArray
    path: FloatArray
    facing: FloatArray
    seen: BoolArray

    @cached_property
    def ray(self) -> FloatArray:
        """Unit vectors (n, m, 3) from the chaser."""
        return np.asarray(self.ideal / np.linalg.norm(self.ideal, axis=2, keepdims=True))

    @cached_property
    def spread(self) -> float:
        """The rms distance of what is seen from the mean of its frame, m."""
        weight = self.seen / np.maximum(self.seen.sum(axis=1, keepdims=True), 1)
        centre = np.einsum("nm,nmi->ni", weight, self.ideal)
        return float(np.sqrt(np.mean(np.sum((self.ideal - centre[:, None]) ** 2, axis=2)[self.seen])))


@dataclass(frozen=True)
class Sensor:
    """depth: deviation along the ray over that across it; covariances: given with the tracks, too large by `factor`;
    dof: of Student's distribution, 0 for a normal one; drift: share of the variance that is correlated, over how many
    frames, along axes of B; by_angle: power of the cosine of the view angle over which deviations grow; by_edge: what
    they gain at the edge of the image; uneven (m,): factors of the labels; common: turn of the camera in each frame,
    rad; jitter: of the frames' times, s; tissue: deviation in m of what moves the features, and over how many frames.
    """

    depth: float = 1.0
    covariances: bool = False
    factor: float = 1.0
    dof: int = 0
    drift: tuple[float, float] = (0.0, 1.0)
    by_angle: float = 0.0
    by_edge: float = 0.0
    uneven: tuple[float, ...] = ()
    common: float = 0.0
    jitter: float = 0.0
    tissue: tuple[float, float] = (0.0, 1.0)

    def words(self) -> list[str]:
        """Each kind of noise with its size."""
        share, frames = self.drift
        tissue, slow = self.tissue
        said = {
            f"depth {self.depth:.1f} times as uncertain, {'told' if self.covariances else 'untold'}": self.depth != 1,
            f"rig's covariances times {self.factor:.2f}": self.factor != 1,
            f"Student noise {self.dof}": self.dof,
            f"AR noise {frames:.0f} frames {100 * share:.0f} %": share,
            f"noise by view angle ^-{self.by_angle:.2g}": self.by_angle,
            f"noise by edge +{100 * self.by_edge:.0f} %": self.by_edge,
            f"uneven noise {min(self.uneven, default=1):.1f} to {max(self.uneven, default=1):.1f}": self.uneven,
            f"common mode {self.common:.1e} rad": self.common,
            f"jitter {1e3 * self.jitter:.2g} ms": self.jitter,
            f"soft tissue {1e3 * tissue:.2g} mm, {slow:.0f} frames": tissue,
        }
        return [words for words, true in said.items() if true]


def drawn(rng: np.random.Generator, plan: Plan, noise: float, watch: Watch) -> Sensor:
    """The sensor of a plan; noise: its deviation, m, to which what is common to all points is held."""
    names, labels = plan.mismatches, watch.seen.shape[1]
    depth = log_uniform(rng, 1.3, 8) if plan.telling in (RIG, UNTOLD_RIG) else 1.0
    uneven = np.exp(rng.normal(0, log_uniform(rng, 0.1, 0.5), labels)) if "uneven noise" in names else np.zeros(0)
    tissue = log_uniform(rng, 3e-4, 5e-3), log_uniform(rng, 5, 60)
    drift = rng.uniform(0.1, 0.9), log_uniform(rng, 2, 20)
    distance = float(np.linalg.norm(watch.ideal, axis=2).mean())
    speed = float(np.sqrt((watch.velocity**2).sum(axis=2).mean()))
    return Sensor(
        depth,
        plan.telling == RIG,
        log_uniform(rng, 0.6, 1.6) if "wrong rig" in names else 1.0,
        int(rng.integers(4, 9)) if "Student noise" in names else 0,
        (float(drift[0]), drift[1]) if "drifting templates" in names else (0.0, 1.0),
        log_uniform(rng, 0.3, 1.0) if "noise by view angle" in names else 0.0,
        log_uniform(rng, 0.2, 3) if "noise by edge" in names else 0.0,
        tuple(uneven.tolist()),
        min(log_uniform(rng, 1e-5, 1e-3), noise / distance) if "common mode" in names else 0.0,
        min(log_uniform(rng, *JITTER), noise / speed) if "jitter" in names else 0.0,
        tissue if "soft tissue" in names else (0.0, 1.0),
    )


def covariances(sensor: Sensor, noise: float, watch: Watch) -> FloatArray:
    """What a rig says of its noise (n, m, 3, 3) in C, m²: across and along the rays, growing with the range."""
    distance = np.linalg.norm(watch.ideal, axis=2)
    relative = distance / distance.mean() if sensor.depth != 1 else np.ones_like(distance)
    across = noise * np.sqrt(3 / (2 + sensor.depth**2)) * relative
    along = across * sensor.depth * relative
    outer = watch.ray[..., :, None] * watch.ray[..., None, :]
    return np.asarray(across[..., None, None] ** 2 * (np.eye(3) - outer) + along[..., None, None] ** 2 * outer)


def scales(sensor: Sensor, watch: Watch) -> FloatArray:
    """By what factor (n, m) deviations are larger than on average; their mean square over what is seen is 1."""
    found = np.ones(watch.seen.shape)
    if sensor.by_angle:
        found = found * np.maximum(watch.facing, LEAST_COSINE) ** -sensor.by_angle
    if sensor.by_edge:
        centre = watch.path / np.linalg.norm(watch.path, axis=1, keepdims=True)
        offset = np.linalg.norm(watch.ray - centre[:, None], axis=2)
        found = found * (1 + sensor.by_edge * (offset / offset[watch.seen].max()) ** 2)
    if sensor.uneven:
        found = found * np.array(sensor.uneven)
    return np.asarray(found / np.sqrt(np.mean(found[watch.seen] ** 2)))


def marginal(sensor: Sensor, own: FloatArray, watch: Watch) -> FloatArray:
    """Covariances (n, m, 3, 3) of all of an observation's noise, of those of its own, m²."""
    y, v = watch.ideal, watch.velocity
    squared = np.sum(y**2, axis=2)[..., None, None]
    found = own + sensor.common**2 * (squared * np.eye(3) - y[..., :, None] * y[..., None, :])
    found += sensor.jitter**2 * v[..., :, None] * v[..., None, :]
    return np.asarray(found + sensor.tissue[0] ** 2 * np.eye(3))


def noises(rng: np.random.Generator, sensor: Sensor, own: FloatArray, watch: Watch) -> FloatArray:
    """A draw (n, m, 3) in C of all noise, m; own (n, m, 3, 3): covariances of an observation's own part, m²."""
    frames, labels = watch.seen.shape
    share, correlated = sensor.drift
    unit = student(rng, sensor.dof, (frames, labels))
    if share:
        drift = np.einsum("nij,nmj->nmi", watch.attitude, autoregressive(rng, correlated, (frames, labels, 3)))
        unit = np.sqrt(1 - share) * unit + np.sqrt(share) * drift
    found = np.einsum("nmij,nmj->nmi", np.linalg.cholesky(own), unit)
    if sensor.common:
        found = found + np.cross(sensor.common * rng.standard_normal((frames, 1, 3)), watch.ideal)
    if sensor.jitter:
        found = found + sensor.jitter * rng.standard_normal((frames, 1, 1)) * watch.velocity
    size, slow = sensor.tissue
    if size:
        patch = autoregressive(rng, slow, (frames, 1, 3)) + autoregressive(rng, slow, (frames, labels, 3))
        found = found + np.einsum("nij,nmj->nmi", watch.attitude, size * np.sqrt(0.5) * patch)
    return np.asarray(found)


def student(rng: np.random.Generator, dof: int, shape: tuple[int, int]) -> FloatArray:
    """Vectors (n, m, 3) of unit covariance, each of Student's distribution, or normal with dof 0."""
    unit = rng.standard_normal((*shape, 3))
    if dof:
        unit *= np.sqrt((dof - 2) / rng.chisquare(dof, (*shape, 1)))
    return unit


def autoregressive(rng: np.random.Generator, frames: float, shape: tuple[int, ...]) -> FloatArray:
    """Noise of unit variance whose correlation falls to 1/e in that many frames of the first axis."""
    kept = np.exp(-1 / frames)
    found = rng.standard_normal(shape)
    found[1:] *= np.sqrt(1 - kept**2)
    for k in range(1, len(found)):
        found[k] += kept * found[k - 1]
    return found
