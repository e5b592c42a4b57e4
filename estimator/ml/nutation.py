"""The inertia of a body that hardly nutates, from the frequency and the ellipse of its nutation.

In body axes, the momentum's direction p of a free body near a spin about the principal axis of moment C moves on an
ellipse about that axis. With moments A and B along the ellipse's axes, of ratio e = p_B/p_A, its frequency is λ = ℓ Ω,
and with x = C/A − 1, y = C/B − 1 Euler's equation gives ℓ² = x y and e² = x/y: x = ±ℓ e and y = ±ℓ/e, where the sign is
the sense of the motion. Rates from short windows of attitudes are too noisy for this, and in the inertia the likelihood
of such motion has as many maxima as its frequency has.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.inertia import of_a_body

FloatArray = NDArray[np.float64]

STEADY = 0.35  # rad, the median angle between the axis and the momentum, up to which they are near
FEWEST = 12  # frames
PER_WAVE = 4  # frequencies tried for one period in the span
MOST_TRIED = 2000  # frequencies
PART = 200  # of them at once
WRONG = 4.0  # angle over the median, above which an attitude is wrong
ROUNDEST, FLATTEST = 0.999, 1e-3  # of the ellipse's axes
SLIMMEST = -0.98  # C/B − 1 of a rod


@dataclass(frozen=True, eq=False)
class NearSpin:
    """A motion near a spin: inertia (3, 3) of trace 1, and rates (n, 3) in rad/s at the times, in the body's axes.

    width: the smaller half-axis of the ellipse on which the momentum's direction moves, rad.
    """

    inertia: FloatArray
    rate: FloatArray
    width: float


def near_spins(time: FloatArray, R: FloatArray, rate: FloatArray) -> tuple[NearSpin, ...]:
    """Motions with the nutation of attitudes R (n, 3, 3) at times (n,) in s, for both senses; none if it is none.

    rate (3,): a typical one, rad/s, in the body's axes.
    """
    span, speed = float(time[-1] - time[0]), float(np.linalg.norm(rate))
    count = int(PER_WAVE * speed * span / (2 * np.pi))
    if len(time) < FEWEST or not PER_WAVE <= count <= MOST_TRIED:
        return ()
    axes = _axes_along(rate / speed)
    momentum = (R @ axes[2]).mean(axis=0)
    in_C = _axes_along(momentum / np.linalg.norm(momentum))
    seen = np.einsum("kij,li,mj->klm", R, in_C, axes)  # axes of C in those of the body
    p = seen[:, 2, :2]
    angle = np.linalg.norm(p, axis=1)
    median = float(np.median(angle))
    right = angle <= WRONG * median
    if median > STEADY or right.sum() < FEWEST:
        return ()
    # A constant tilt of the axis in the body, and one of the momentum in C.
    known = np.concatenate([np.broadcast_to(np.eye(2), (len(p), 2, 2)), np.swapaxes(seen[:, :2, :2], 1, 2)], axis=2)
    at = time - time[0]
    tried = np.linspace(2, count, count - 1) * (2 * np.pi / span / PER_WAVE)
    frequency = _frequency(at[right], p[right], known[right], tried)
    waves = _waves(at, frequency)
    rows = np.concatenate([known, waves], axis=2)
    found = np.linalg.lstsq(rows[right].reshape(-1, 8), p[right].ravel(), rcond=None)[0]
    axis = axes[2] + found[:2] @ axes[:2]
    axes = _axes_along(axis / np.linalg.norm(axis), axes[0])
    ellipse, moved = found[4:].reshape(2, 2), waves @ found[4:]
    sense = 1.0 if np.linalg.det(ellipse) >= 0 else -1.0
    return tuple(_near_spin(ellipse, frequency / speed, sign, axes, moved, speed) for sign in (sense, -sense))


def _near_spin(
    ellipse: FloatArray, ratio: float, sense: float, axes: FloatArray, moved: FloatArray, speed: float
) -> NearSpin:
    """The motion with an ellipse (2, 2) of the momentum's direction, in the first two of axes (3, 3), by rows.

    ratio of the frequencies; moved (n, 2): the direction over time; speed in rad/s.
    """
    along, sizes, _ = np.linalg.svd(ellipse)
    e = float(np.clip(sizes[1] / max(sizes[0], 1e-300), FLATTEST, ROUNDEST))
    x, y = (max(sense * ratio * own, SLIMMEST) for own in (e, 1 / e))
    basis = np.concatenate([along.T @ axes[:2], axes[2:]])
    inertia = of_a_body(basis.T @ np.diag([1 / (1 + x), 1 / (1 + y), 1.0]) @ basis)
    momentum = axes[2] + moved @ axes[:2]
    turned = momentum @ np.linalg.inv(inertia)
    rate = speed * turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return NearSpin(inertia, rate, float(sizes[1]))


def _frequency(time: FloatArray, p: FloatArray, known: FloatArray, tried: FloatArray) -> float:
    """The frequency in rad/s, of those tried (k,), whose ellipse explains most of p (n, 2) beside known (n, 2, 4)."""
    q = np.linalg.qr(known.reshape(-1, known.shape[2]))[0]
    rest = p.ravel() - q @ (q.T @ p.ravel())
    explained = []
    for first in range(0, len(tried), PART):
        phase = tried[first : first + PART, None] * time
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        inner = np.einsum("kan,kbn->kab", waves, waves, optimize=True)
        gram = np.einsum("ij,kab->kiajb", np.eye(2), inner).reshape(-1, 4, 4)
        by_q = np.einsum("kan,nic->kiac", waves, q.reshape(len(time), 2, -1), optimize=True).reshape(len(phase), 4, -1)
        by_rest = np.einsum("kan,ni->kia", waves, rest.reshape(-1, 2), optimize=True).reshape(-1, 4)
        gram = gram - by_q @ np.swapaxes(by_q, 1, 2) + 1e-9 * len(time) * np.eye(4)
        explained.append(np.einsum("ka,ka->k", by_rest, np.linalg.solve(gram, by_rest[..., None])[..., 0]))
    return float(tried[int(np.argmax(np.concatenate(explained)))])


def _waves(time: FloatArray, frequency: float) -> FloatArray:
    """The Jacobian (n, 2, 4) of an ellipse by its elements (2, 2), of the cosine and the sine for each axis."""
    wave = np.stack([np.cos(frequency * time), np.sin(frequency * time)], axis=1)
    return np.asarray(np.einsum("ij,nb->nijb", np.eye(2), wave).reshape(-1, 2, 4))


def _axes_along(axis: FloatArray, near: FloatArray | None = None) -> FloatArray:
    """Right-handed axes (3, 3), by rows, of which the last is a unit vector (3,); near (3,): the first, about."""
    near = np.eye(3)[int(np.argmin(np.abs(axis)))] if near is None else near
    first = near - axis * (axis @ near)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis])
