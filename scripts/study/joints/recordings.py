"""Recordings of two bodies on a joint, each from a seed: motions, and noise of skin and joint in several rhythms."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]

FRAMES, STEP = 600, 0.02  # s
SKIN, OWN = 0.003, 0.00075  # m: of a segment's skin per coordinate, and of each marker
FLABBY = 0.01  # m, of the skin under each marker by itself, as on a thigh (Leardini et al., Gait Posture 21, 2005)
LASTING, DRIFTING = 0.2, 2.0  # s, for which skin stays to one side
RINGING, DAMPING = 1.5, 0.1  # Hz, and the share of critical damping
GAIT = 0.9  # strides a second
HARMONICS = (1.0, 0.7, 0.4)  # relative sizes of what is in step with the gait
SHAPE = np.array([[0.1, 0.0, 0.0], [-0.08, 0.09, 0.0], [-0.07, -0.08, 0.03], [0.0, 0.02, 0.11]])
IN_PARENT, IN_CHILD = np.array([0.1, 0.2, 0.3]), np.array([0.02, -0.03, -0.2])  # m, the joint


@dataclass(frozen=True, eq=False)
class Recording:
    """time (n,), s; markers of both bodies (n, 4, 3), m; in the room the joint (n, 3), m, and a hinge's axis (n, 3)."""

    time: FloatArray
    parent: FloatArray
    child: FloatArray
    joint: FloatArray
    axis: FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """Rotation vectors (n, 3), rad, of the parent in the room and the child in the parent; phase (n,) of the gait."""

    parent: FloatArray
    child: FloatArray
    phase: FloatArray


def circles(rng: np.random.Generator) -> Motion:
    """Slow turns of ±40° and ±46° about all axes, out of step with each other, as a subject is asked to make."""
    t = _time()[:, None]
    shift = rng.uniform(0, 2 * np.pi, (2, 3))
    parent = 0.7 * np.sin(2 * np.pi * np.array([0.31, 0.47, 0.23]) * t + shift[0])
    child = 0.8 * np.sin(2 * np.pi * np.array([0.53, 0.37, 0.71]) * t + shift[1])
    return Motion(parent, child, 2 * np.pi * 0.5 * t[:, 0])


def gait(rng: np.random.Generator) -> Motion:
    """Strides of which no two are as long: flexion of ±25°, ±9° about the two other axes, and their harmonics."""
    pace = 1 + 0.05 * lasting(rng, (FRAMES, 1), 1.0)[:, 0]
    phase = 2 * np.pi * GAIT * STEP * np.cumsum(pace)
    shift = rng.uniform(0, 2 * np.pi, 9)

    def wave(harmonic: int, size: float, which: int) -> FloatArray:
        return np.asarray(size * np.cos(harmonic * phase - shift[which]))

    parent = np.transpose([wave(1, 0.08, 0), wave(1, 0.07, 1), wave(2, 0.05, 2)])
    child = [wave(1, 0.15, 3) + wave(2, 0.06, 4), -0.17 + wave(1, 0.38, 5) + wave(2, 0.1, 6)]
    return Motion(parent, np.transpose([*child, wave(1, 0.12, 7) + wave(2, 0.06, 8)]), phase)


def hinge(rng: np.random.Generator) -> Motion:
    """The gait of a knee: flexion alone, about y."""
    both = gait(rng)
    return Motion(both.parent, both.child * [0.0, 1.0, 0.0], both.phase)


MOTIONS: dict[str, Callable[[np.random.Generator], Motion]] = {"circles": circles, "gait": gait, "hinge": hinge}


def lasting(rng: np.random.Generator, shape: tuple[int, ...], seconds: float) -> FloatArray:
    """Noise of first order along the first axis, of the variance 1."""
    from scipy.signal import lfilter  # slow to load, and hinges without noise in time do without

    memory = np.exp(-STEP / seconds)
    before = round(20 * seconds / STEP)
    white = rng.normal(size=(shape[0] + before, *shape[1:])) * np.sqrt(1 - memory**2)
    return np.asarray(lfilter([1], [1, -memory], white, axis=0)[before:])


def ringing(rng: np.random.Generator) -> FloatArray:
    """Noise of second order (n, 3) that oscillates at RINGING, of the variance 1."""
    from scipy.signal import lfilter  # slow to load, and other noise does without

    turn = 2 * np.pi * RINGING * STEP
    size = np.exp(-DAMPING * turn)
    middle = 2 * size * np.cos(turn * np.sqrt(1 - DAMPING**2))
    rung = lfilter([1], [1, -middle, size**2], rng.normal(size=(FRAMES + 2000, 3)), axis=0)[2000:]
    variance = (1 + size**2) / ((1 - size**2) * ((1 + size**2) ** 2 - middle**2))
    return np.asarray(rung / np.sqrt(variance))


def in_step(rng: np.random.Generator, motion: Motion) -> FloatArray:
    """A random function (n, 3) of the gait's phase that is the same in each stride, of the variance 1 over draws."""
    waves = [wave((k + 1) * motion.phase) for k in range(len(HARMONICS)) for wave in (np.cos, np.sin)]
    size = np.repeat(HARMONICS, 2)[:, None] * rng.normal(size=(2 * len(HARMONICS), 3))
    return np.asarray(np.transpose(waves) @ size / np.linalg.norm(HARMONICS))


def by_angle(rng: np.random.Generator, motion: Motion) -> FloatArray:
    """A random linear map (n, 3) of the joint's angles, of the variance 1 over draws."""
    angle = motion.child - motion.child.mean(axis=0)
    return np.asarray(angle @ rng.normal(size=(3, 3)) / np.sqrt(np.mean(np.sum(angle**2, axis=1))))


def each_by_angle(rng: np.random.Generator, motion: Motion) -> FloatArray:
    """The same of each marker by itself (n, 4, 3), over SKIN, as large as FLABBY."""
    return np.stack([FLABBY / SKIN * by_angle(rng, motion) for _ in SHAPE], axis=1)


Skin = Callable[[np.random.Generator, Motion], FloatArray]
NOISES: dict[str, Skin] = {
    "white": lambda rng, _: rng.normal(size=(FRAMES, 3)),
    "lasting": lambda rng, _: lasting(rng, (FRAMES, 3), LASTING),
    "drifting": lambda rng, _: lasting(rng, (FRAMES, 3), DRIFTING),
    "ringing": lambda rng, _: ringing(rng),
    "in step": in_step,
    "in step and lasting": lambda rng, motion: (
        np.sqrt(0.5) * (in_step(rng, motion) + lasting(rng, (FRAMES, 3), LASTING))
    ),
    "by angle": by_angle,
    "by angle, child": by_angle,
    "by angle, each marker": each_by_angle,
}
ONE_BODY = "by angle, child"  # of which the parent's skin stays
SLACK = "loose joint"  # of which the joint itself wanders by as much, and skin does not


def recorded(motion: str, noise: str, seed: int) -> Recording:
    """A recording; the seed's motion and noise are the same in each call."""
    rng = np.random.default_rng(seed)
    moved = MOTIONS[motion](rng)
    t = _time()
    R_T_P = Rotation.from_rotvec(moved.parent).as_matrix()
    R_T_C = R_T_P @ Rotation.from_rotvec(moved.child).as_matrix()
    origin = np.array([0.5, 0.1, 1.0]) + 0.1 * np.sin(t[:, None] + np.arange(3))
    joint = origin + R_T_P @ IN_PARENT
    loose = np.zeros((FRAMES, 3))
    if noise == SLACK:
        loose = SKIN * np.sqrt(0.5) * (rng.normal(size=(FRAMES, 3)) + lasting(rng, (FRAMES, 3), LASTING))
    bodies = []
    for R, place in ((R_T_P, origin), (R_T_C, joint + np.einsum("kij,kj->ki", R_T_P, loose) - R_T_C @ IN_CHILD)):
        stays = noise == SLACK or (noise == ONE_BODY and R is R_T_P)
        skin = np.zeros((FRAMES, 3)) if stays else SKIN * NOISES[noise](rng, moved)
        skin = skin.reshape(FRAMES, -1, 3)  # of all markers, or of each
        points = place[:, None] + (SHAPE + skin) @ np.swapaxes(R, 1, 2)
        bodies.append(points + OWN * rng.normal(size=points.shape))
    return Recording(t, bodies[0], bodies[1], joint, R_T_P[:, :, 1])


def _time() -> FloatArray:
    return np.asarray(np.arange(FRAMES) * STEP)
