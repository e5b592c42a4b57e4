"""Bodies with their mass, and how they turn: stages, buses, panels, cubes, balls and rocks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import TURN, log_uniform, unit
from baryscope.study.population.second.shapes import Box, Cylinder, Ellipsoid, Shape

FloatArray = NDArray[np.float64]

KINDS = {"stage": 0.25, "bus": 0.15, "winged": 0.2, "panel": 0.12, "cube": 0.1, "sphere": 0.08, "rock": 0.1}
SYMMETRIC = {"stage": 0.2, "sphere": 0.3}  # shares of a kind
SLOWEST, FASTEST = 0.1, 20.0  # °/s
STYLES = {"tumble": 0.36, "flat spin": 0.2, "pure spin": 0.1, "cone": 0.18, "unstable": 0.16}


@dataclass(frozen=True, eq=False)
class Body:
    """shape; inertia (3, 3) about the CoM, kg m²; com (3,): the CoM in the shape's axes, m; size: its length, m."""

    shape: Shape
    inertia: FloatArray
    com: FloatArray
    size: float
    words: str


def draw_body(rng: np.random.Generator) -> Body:
    """A body whose mass is spread at random with up to three lumps, but for a few that are symmetric exactly."""
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    shape, size = _shape(rng, kind)
    if isinstance(shape, Cylinder | Ellipsoid) and kind in SYMMETRIC and rng.random() < SYMMETRIC[kind]:
        com, inertia = _symmetric(rng, shape, size)
        kind += " symmetric"
    else:
        com, inertia = _lumpy(rng, shape, 0.15 if kind == "sphere" else 1.0)
    return Body(shape, inertia * log_uniform(rng, 5, 5000), com, size, f"{kind} {size:.2f}m")


def _shape(rng: np.random.Generator, kind: str) -> tuple[Shape, float]:
    if kind == "stage":
        size = log_uniform(rng, 1.5, 8.0)
        slender = rng.uniform(2.0, 6.0)
        return Cylinder(size / slender / 2 * rng.uniform(0.8, 1.2), size / 2), size
    if kind == "bus":
        size = log_uniform(rng, 0.6, 4.0)
        return Box(size / 2 * rng.uniform(0.35, 1.0, 3)), size
    if kind == "winged":
        size = log_uniform(rng, 1.0, 8.0)
        bus = size * rng.uniform(0.15, 0.35)
        return Box(bus / 2 * rng.uniform(0.7, 1.3, 3), wing=(size - bus) / 2), size
    if kind == "panel":
        size = log_uniform(rng, 0.5, 6.0)
        return Box(size / 2 * np.array([1.0, rng.uniform(0.3, 1.0), rng.uniform(0.01, 0.08)])), size
    if kind == "cube":
        size = log_uniform(rng, 0.3, 1.5)
        return Box(size / 2 / np.sqrt(3) * np.ones(3) * rng.uniform(0.95, 1.05, 3)), size
    if kind == "sphere":
        size = log_uniform(rng, 0.4, 3.0)
        return Ellipsoid(size / 2 * rng.uniform(0.93, 1.07, 3)), size
    size = log_uniform(rng, 0.4, 5.0)
    return Ellipsoid(size / 2 * np.sort(rng.uniform(0.3, 1.0, 3)), rough=rng.uniform(0.1, 0.5)), size


def _symmetric(rng: np.random.Generator, shape: Cylinder | Ellipsoid, size: float) -> tuple[FloatArray, FloatArray]:
    """CoM (3,) and inertia (3, 3) over the mass: of a stage with an engine on its axis, or of a ball."""
    if isinstance(shape, Cylinder):
        shift = rng.uniform(0.1, 0.5) * shape.half * rng.choice([-1, 1])
        across = (3 * shape.radius**2 + 4 * shape.half**2) / 12
        return np.array([0, 0, shift]), np.diag([across, across, shape.radius**2 / 2])
    com = unit(rng) * 0.05 * size * rng.uniform(0.3, 2)
    return np.asarray(com), np.eye(3) * 0.4 * shape.axes.mean() ** 2


def _lumpy(rng: np.random.Generator, shape: Shape, heavy: float) -> tuple[FloatArray, FloatArray]:
    """CoM (3,) and inertia (3, 3) over the mass, of grains and one to three lumps; heavy: a factor on the lumps."""
    count = int(rng.integers(60, 400))
    masses, where = rng.gamma(2.0, size=count), shape.inside(rng, count)
    lumps = int(rng.integers(1, 4))  # engine, tank, batteries
    where = np.vstack([where, shape.inside(rng, lumps)])
    masses = np.append(masses / masses.sum(), rng.uniform(0.05, 0.4, lumps) * heavy)
    com = masses @ where / masses.sum()
    arm = where - com
    square = (arm**2).sum(1)[:, None, None] * np.eye(3)
    inertia = np.einsum("k,kij->ij", masses, square - arm[:, :, None] * arm[:, None])
    return com, inertia / masses.sum()


def draw_rate(rng: np.random.Generator, inertia: FloatArray) -> tuple[FloatArray, str]:
    """The rate (3,) in B, rad/s, and its words: any direction, or near a principal axis of the inertia (3, 3)."""
    _, axes = np.linalg.eigh(inertia)  # rising: axis of least inertia first
    speed = 0.0
    while not SLOWEST <= speed <= FASTEST:
        speed = float(np.exp(rng.normal(np.log(2.5), 1.2)))
    style = str(rng.choice(list(STYLES), p=list(STYLES.values())))
    text = style
    if style == "tumble":
        direction = unit(rng)
    else:
        about, tilt = _near_axis(rng, style)
        turn = rng.uniform(0, TURN)
        direction = np.zeros(3)
        direction[about] = np.cos(tilt) * rng.choice([-1.0, 1.0])
        across = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn)
        direction[(about + 1) % 3], direction[(about + 2) % 3] = across
        text = f"{style} {np.rad2deg(tilt):.2g}deg off axis {about + 1}"
    return np.deg2rad(speed) * axes @ direction, f"{text} at {speed:.2f}deg/s"


def _near_axis(rng: np.random.Generator, style: str) -> tuple[int, float]:
    """Which principal axis, least inertia first, and the angle from it, rad."""
    if style == "flat spin":
        return 2, float(np.deg2rad(abs(rng.normal(0, 8)) + 0.3))
    if style == "pure spin":
        return int(rng.choice([0, 2])), float(np.deg2rad(log_uniform(rng, 0.01, 1.0)))
    if style == "cone":
        return 0, float(np.deg2rad(rng.uniform(12, 75)))
    return 1, float(np.deg2rad(log_uniform(rng, 0.3, 12)))
