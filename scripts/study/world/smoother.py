"""A peer: the nine-state Kalman smoother of (r, v, d) with white acceleration of estimated density.

r and v are the centre of mass from the chaser in LVLH, d the centroid of the features from it in the registered body's
axes. Transition by Yamanaka and Ankersen (2002); the measurement is the centroid of a frame, R_I_L r + R d, with the
noise of the centroid and of the registered attitude. The density is that of the highest likelihood of the innovations;
for a fixed pivot the same holds of a white noise of position. Its authors would register all frames first, as here.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_transition
from baryscope.study.world.forces import Burn

FloatArray = NDArray[np.float64]

DENSITIES = np.concatenate([[0.0], np.logspace(-18, -3, 61)])  # m²/s³
SHIFTS = np.concatenate([[0.0], np.logspace(-14, 0, 57)])  # m², variances of a pivot's position
VAGUE = np.repeat([20.0, 0.1, 20.0], 3)  # m, m/s, m: deviations before the first frame, round its centroid
PASSES = 3  # with an attitude noise that depends on d


@dataclass(frozen=True, eq=False)
class Poses:
    """Registered frames: attitude (n, 3, 3) from the body's axes to C, centroid (n, 3) in C, m; sigma of a coordinate;
    turn (n, 3, 3): covariance of the attitude's error in C, rad².
    """

    attitude: FloatArray
    centroid: FloatArray
    sigma: float
    turn: FloatArray
    features: int


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The path (n, 3) in C, m, its covariance (n, 3, 3), and the density or variance that was found."""

    position: FloatArray
    covariance: FloatArray
    density: float


def registered(position: FloatArray) -> Poses:
    """Generalised Procrustes registration of frames (n, m, 3) in which every feature is seen."""
    n, m, _ = position.shape
    centroid = position.mean(axis=1)
    centred = position - centroid[:, None]
    shape = centred[0]
    for _ in range(10):
        U, _, Vt = np.linalg.svd(np.swapaxes(centred, 1, 2) @ shape)
        U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
        R = U @ Vt
        shape = np.mean(centred @ R, axis=0)
    residual = centred - shape @ np.swapaxes(R, 1, 2)
    sigma = float(np.sqrt((residual**2).sum() / (3 * n * m - 6 * n - 3 * m + 6)))
    arms = np.sum(shape**2) * np.eye(3) - shape.T @ shape
    return Poses(R, centroid, sigma, sigma**2 * R @ np.linalg.inv(arms) @ np.swapaxes(R, 1, 2), m)


def smoothed(
    time: FloatArray, position: FloatArray, orbit: Orbit | None, burns: tuple[Burn, ...] | None = None
) -> Smoothed:
    """The path of tracks (n, m, 3) at times (n,) in s on a relative orbit, or at a fixed point if there is no orbit."""
    poses = registered(position)
    axes, transition = np.tile(np.eye(3), (len(time), 1, 1)), np.tile(np.eye(9), (len(time) - 1, 1, 1))
    density, shift, moving = np.zeros_like(SHIFTS), SHIFTS, 0.0
    if orbit is not None:
        axes = lvlh_attitude(orbit, time)
        for k in range(len(time) - 1):
            transition[k, :6, :6] = relative_transition(orbit, time[k + 1 : k + 2], float(time[k]))[0]
        density, shift, moving = DENSITIES, np.zeros_like(DENSITIES), 1.0
    known = _increments(time, burns or ())
    arm = np.zeros(3)
    for _ in range(PASSES):
        H = np.concatenate([axes, np.zeros_like(axes), poses.attitude], axis=2)
        model = _Model(H, poses.centroid, _noise(poses, arm), transition, _driven(time), known, moving)
        likelihood, _, last = _filtered(model, density, shift)
        best = int(np.argmax(likelihood))
        arm = last[best, 6:]
    chosen = slice(best, best + 1)
    _, forwards, _ = _filtered(model, density[chosen], shift[chosen])
    _, backwards, _ = _filtered(model.reversed, density[chosen], shift[chosen])
    x, P = _merged(forwards, backwards[::-1])
    path = np.einsum("nij,nj->ni", axes, x[:, :3])
    covariance = axes @ P[:, :3, :3] @ np.swapaxes(axes, 1, 2)
    return Smoothed(path, covariance, float(max(density[best], shift[best])))


@dataclass(frozen=True, eq=False)
class _Model:
    observed: FloatArray  # (n, 3, 9): the centroid by the state
    centroid: FloatArray  # (n, 3), m
    noise: FloatArray  # (n, 3, 3), m²
    transition: FloatArray  # (n - 1, 9, 9)
    driven: FloatArray  # (n - 1, 9, 9): covariance that a density of 1 m²/s³ adds in each step
    known: FloatArray  # (n - 1, 9): what logged burns add to the state
    moving: float  # 1, or 0 for a fixed pivot, which has no velocity

    @property
    def reversed(self) -> "_Model":
        """The same from the last frame to the first."""
        back = np.asarray(np.linalg.inv(self.transition)[::-1])
        driven = np.asarray(back @ self.driven[::-1] @ np.swapaxes(back, 1, 2))
        known = -np.einsum("nij,nj->ni", back, self.known[::-1])
        return _Model(self.observed[::-1], self.centroid[::-1], self.noise[::-1], back, driven, known, self.moving)


def _noise(poses: Poses, arm: FloatArray) -> FloatArray:
    """σ²/m and [R d]× C [R d]×ᵀ."""
    lever = np.cross(np.eye(3), (poses.attitude @ arm)[:, None]).transpose(0, 2, 1)
    return np.asarray(poses.sigma**2 / poses.features * np.eye(3) + lever @ poses.turn @ np.swapaxes(lever, 1, 2))


def _increments(time: FloatArray, burns: tuple[Burn, ...]) -> FloatArray:
    """What burns of the chaser change the state (r, v, d) by in each step: r is from the chaser, so against them."""
    found = np.zeros((len(time) - 1, 9))
    for burn in burns:
        begin, end = np.maximum(time[:-1], burn.begin), np.minimum(time[1:], burn.end)
        on = end > begin
        travel = ((time[1:] - begin) ** 2 - (time[1:] - end) ** 2) / 2
        found[on, :3] -= travel[on, None] * burn.acceleration
        found[on, 3:6] -= (end - begin)[on, None] * burn.acceleration
    return found


def _driven(time: FloatArray) -> FloatArray:
    """[T³/3 T²/2; T²/2 T] of (r, v) for each step T."""
    found = np.zeros((len(time) - 1, 9, 9))
    for k, T in enumerate(np.diff(time)):
        found[k, :6, :6] = np.kron(np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]), np.eye(3))
    return found


def _filtered(
    model: _Model, density: FloatArray, shift: FloatArray
) -> tuple[FloatArray, list[tuple[FloatArray, ...]], FloatArray]:
    """The log-likelihood (c,) of c candidates, the last states (c, 9), and of the first candidate for each frame the
    state and its covariance before and after it.
    """
    c = len(density)
    axes = model.observed[0, :, :3]
    x = np.tile(np.concatenate([axes.T @ model.centroid[0], np.zeros(6)]), (c, 1))
    P = np.tile(np.diag(VAGUE**2 * np.repeat([1.0, model.moving, 1.0], 3)), (c, 1, 1))
    likelihood: FloatArray = np.zeros(c)
    history: list[tuple[FloatArray, ...]] = []
    for k, H in enumerate(model.observed):
        if k:
            F = model.transition[k - 1]
            x = x @ F.T + model.known[k - 1]
            P = F @ P @ F.T + density[:, None, None] * model.driven[k - 1]
        before = (x[0], P[0])
        R = model.noise[k] + shift[:, None, None] * np.eye(3)
        S = H @ P @ H.T + R
        inverse = np.linalg.inv(S)
        off = model.centroid[k] - x @ H.T
        gain = P @ H.T @ inverse
        x = x + np.einsum("cij,cj->ci", gain, off)
        left = np.eye(9) - gain @ H
        P = left @ P @ np.swapaxes(left, 1, 2) + gain @ R @ np.swapaxes(gain, 1, 2)
        likelihood -= (np.linalg.slogdet(S)[1] + np.einsum("ci,cij,cj->c", off, inverse, off)) / 2
        history.append((*before, x[0], P[0]))
    return likelihood, history, x


def _merged(
    forwards: list[tuple[FloatArray, ...]], backwards: list[tuple[FloatArray, ...]]
) -> tuple[FloatArray, FloatArray]:
    """States (n, 9) and covariances from all frames up to each, its own among them, and from all after it."""
    states, covariances = [], []
    for (_, _, x, P), (y, Q, _, _) in zip(forwards, backwards, strict=True):
        gain = P @ np.linalg.pinv(P + Q, hermitian=True, rcond=1e-13)
        states.append(x + gain @ (y - x))
        left = np.eye(9) - gain
        covariances.append(left @ P @ left.T + gain @ Q @ gain.T)
    return np.array(states), np.array(covariances)
