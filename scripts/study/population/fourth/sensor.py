"""The noise of a sensor: alike in all directions, or that of a rig, which is less certain of the depth."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.fourth.blunders import KINDS
from baryscope.study.population.fourth.chance import log_uniform
from baryscope.study.population.interface import FloatArray

FINEST, COARSEST = 1e-3, 0.2  # m
LEVEL = 0.25  # of the features' radius, which the noise of three quarters of the cases is held to


@dataclass(frozen=True)
class Sensor:
    """noise: standard deviation of a coordinate, or with covariances of the depth at the mean range, m.

    ratio: of the deviations along and across the ray, 0 if there are no covariances; by_measured: covariances are those
    at the measured position, not at the true one; factor: by which all deviations that these tell are too large; told:
    whether the estimator is told the scale of the noise; blunders: share of the observations, of a kind `blunder`.
    """

    noise: float
    ratio: float = 0.0
    by_measured: bool = False
    factor: float = 1.0
    told: bool = True
    blunders: float = 0.0
    blunder: str = ""

    @property
    def sigma(self) -> float | None:
        """The sigma that the estimator is told, if it is: 1 beside covariances."""
        if not self.told:
            return None
        return 1.0 if self.ratio else self.noise

    def covariances(self, position: FloatArray, mean_range: float) -> FloatArray:
        """The noise's covariances (n, m, 3, 3) in C, m², at positions (n, m, 3) in C, m.

        Those of a rig grow with the range across the ray and with its square along it.
        """
        if not self.ratio:
            return np.broadcast_to(self.noise**2 * np.eye(3), (*position.shape, 3))
        distance = np.linalg.norm(position, axis=2)
        ray = position / distance[..., None]
        relative = (distance / mean_range)[..., None, None]
        outer = ray[..., :, None] * ray[..., None, :]
        along, across = self.noise * relative**2, self.noise / self.ratio * relative
        return np.asarray(along**2 * outer + across**2 * (np.eye(3) - outer))

    def words(self) -> str:
        """What is special about it."""
        parts = [f"{1e3 * self.noise:.2g} mm"]
        if self.ratio:
            parts.append(f"rig 1:{self.ratio:.1f} by {'measured' if self.by_measured else 'true'} range")
        if self.told:
            parts.append("told")
        elif self.factor != 1:
            parts.append(f"covariances told times {self.factor:.2f}²")
        if self.blunders:
            parts.append(f"{self.blunder} outliers {100 * self.blunders:.1f} %")
        return ", ".join(parts)


def drawn(rng: np.random.Generator, radius: float) -> Sensor:
    """A sensor of 1 mm to 20 cm; radius: of the features, m."""
    noise = log_uniform(rng, FINEST, COARSEST)
    if rng.random() < 0.75:
        noise = min(noise, LEVEL * radius)
    rig, ratio = rng.random() < 0.4, log_uniform(rng, 1.3, 12)
    by_measured, told = rng.random(2) < [0.5, 1 / 3]
    factor = float(rng.choice([1.0, log_uniform(rng, 0.4, 2.5)]))
    blunders = float(rng.choice([0.0, rng.uniform(0, 0.05), rng.uniform(0.05, 0.2)], p=[0.4, 0.3, 0.3]))
    return Sensor(
        noise,
        ratio if rig else 0.0,
        bool(rig and by_measured),
        factor if rig and not told else 1.0,
        bool(told),
        blunders,
        str(rng.choice(list(KINDS))) if blunders else "",
    )
