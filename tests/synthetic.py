"""Tracks of a tumbling body, made without any of baryscope.models: Euler's equations by DOP853 at 1e-12."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]

ENVISAT = np.array([[17023.3, 397.1, -2171.4], [397.1, 124825.7, 344.2], [-2171.4, 344.2, 129112.2]])
MU = 3.986004418e14


def attitude(inertia: FloatArray, rate0: FloatArray, time: FloatArray, braking: float = 0.0) -> FloatArray:
    """R_I_B (n, 3, 3) of a body that starts with R_I_B = 1 and angular rate rate0 (rad/s, body axes).

    It is torque-free but for −braking ω, N·m s/rad. Many tests have the same: it is integrated once.
    """
    return _attitude(*(np.asarray(one, dtype=np.float64).tobytes() for one in (inertia, rate0, time)), braking).copy()


@cache
def _attitude(inertia_bytes: bytes, rate_bytes: bytes, time_bytes: bytes, braking: float) -> FloatArray:
    """Of so few numbers Python's are faster than arrays."""
    inertia = np.frombuffer(inertia_bytes).reshape(3, 3)
    rate0, time = np.frombuffer(rate_bytes), np.frombuffer(time_bytes)
    rows, inverse = inertia.tolist(), np.linalg.inv(inertia).tolist()

    def slope(_: float, state: FloatArray) -> FloatArray:
        w, x, y, z, p, q, r = state.tolist()
        h = [a * p + b * q + c * r for a, b, c in rows]
        k = h[1] * r - h[2] * q - braking * p
        m = h[2] * p - h[0] * r - braking * q
        n = h[0] * q - h[1] * p - braking * r
        turning = -x * p - y * q - z * r, w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p
        return np.array([*(0.5 * one for one in turning), *(a * k + b * m + c * n for a, b, c in inverse)])

    start = np.concatenate([[1.0, 0, 0, 0], rate0])
    solution = solve_ivp(
        slope, (time[0], time[-1]), start, t_eval=time, method="DOP853", rtol=1e-12, atol=1e-12, max_step=20.0
    )
    return Rotation.from_quat(np.roll(solution.y[:4].T, -1, axis=1)).as_matrix()


@dataclass(frozen=True)
class Orbit:
    """Keplerian elements at time 0 in m and rad, and R_I_L from Kepler's equation."""

    semi_major_axis: float = 7150e3
    eccentricity: float = 0.001
    inclination: float = np.deg2rad(98.55)
    raan: float = 0.3
    periapsis: float = 0.7
    anomaly: float = 0.2

    @property
    def period(self) -> float:
        return float(2 * np.pi * np.sqrt(self.semi_major_axis**3 / MU))

    def R_I_L(self, time: FloatArray) -> FloatArray:
        e = self.eccentricity
        eccentric0 = 2 * np.arctan(np.sqrt((1 - e) / (1 + e)) * np.tan(self.anomaly / 2))
        mean = eccentric0 - e * np.sin(eccentric0) + 2 * np.pi * time / self.period
        eccentric = mean.copy()
        for _ in range(50):
            eccentric -= (eccentric - e * np.sin(eccentric) - mean) / (1 - e * np.cos(eccentric))
        half = np.arctan2(np.sqrt(1 + e) * np.sin(eccentric / 2), np.sqrt(1 - e) * np.cos(eccentric / 2))
        latitude = self.periapsis + 2 * half
        plane = Rotation.from_euler("ZX", [self.raan, self.inclination])
        return (plane * Rotation.from_euler("Z", latitude[:, None])).as_matrix()

    def model(self):  # type: ignore[no-untyped-def]
        """The same orbit as a model of baryscope, which tells that it is exact."""
        from baryscope.models.orbit import Orbit as ModelOrbit

        return ModelOrbit(
            semi_major_axis=self.semi_major_axis,
            eccentricity=self.eccentricity,
            inclination=self.inclination,
            raan=self.raan,
            argument_of_periapsis=self.periapsis,
            true_anomaly=self.anomaly,
            accuracy=0.0,
        )


def box_features(
    count: int, size: tuple[float, float, float], seed: int, centre: tuple[float, float, float] = (0, 0, 0)
) -> FloatArray:
    """Points (count, 3) on the surface of a box around `centre`, origin of the body axes at the centre of mass."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    face = rng.integers(0, 3, count)
    points[np.arange(count), face] = rng.choice([-0.5, 0.5], count)
    return points * np.array(size) + np.array(centre)


@dataclass(frozen=True)
class Case:
    """Tracks and the true values from which they are simulated."""

    tracks: FeatureTracks
    com: FloatArray
    R_I_B: FloatArray
    features: FloatArray


def make_case(
    time: FloatArray,
    R_I_B: FloatArray,
    com: FloatArray,
    features: FloatArray,
    *,
    noise: float = 0.0,
    seed: int = 0,
    clusters: list[tuple[float, float, list[int]]] | None = None,
) -> Case:
    """Tracks of features (m, 3), body axes, of a body with attitude R_I_B and its centre of mass at com (n, 3).

    clusters: (begin, end, features) in s; without them all features are seen always.
    """
    position = com[:, None] + np.einsum("nij,mj->nmi", R_I_B, features)
    position = position + noise * np.random.default_rng(seed).standard_normal(position.shape)
    if clusters is not None:
        seen = np.zeros(position.shape[:2], dtype=bool)
        for begin, end, members in clusters:
            seen[np.ix_((time >= begin) & (time < end), members)] = True
        position[~seen] = np.nan
    labels = tuple(f"F{index}" for index in range(len(features)))
    return Case(FeatureTracks(time, position, labels), com, R_I_B, features)


def rig_tracks(
    time: FloatArray, R_I_B: FloatArray, com: FloatArray, features: FloatArray, *, seed: int, baseline: float = 1.0
) -> FeatureTracks:
    """Tracks of baryscope's own rig of reference at the chaser (1911 px, 0.5 px), of a baseline in m, which looks at
    the target.
    """
    from baryscope.models.scenario import StereoRig
    from baryscope.models.sensor.directions import axes_along
    from baryscope.models.stereo import project, triangulate

    rig, axes = StereoRig(focal_length=1911.0, baseline=baseline, pixel_noise=0.5), axes_along(com)
    pixels = project(rig, axes, make_case(time, R_I_B, com, features).tracks.position)
    pixels = pixels + rig.pixel_noise * np.random.default_rng(seed).standard_normal(pixels.shape)
    position, covariance = triangulate(rig, axes, pixels)
    return FeatureTracks(time, position, tuple(f"F{index}" for index in range(len(features))), covariance)


def differences(function, x: FloatArray, step: float = 1e-6) -> FloatArray:  # type: ignore[no-untyped-def]
    """Jacobian of function (p,) → (k,) by central differences, (k, p)."""
    return np.stack([(function(x + h) - function(x - h)) / (2 * step) for h in step * np.eye(len(x))], axis=1)


def turned_back(points: FloatArray, reference: FloatArray) -> FloatArray:
    """The centroid of points (m, 3) in axes attached to them: rotated to `reference` by scipy's alignment."""
    centred, still = points - points.mean(axis=0), reference - reference.mean(axis=0)
    return Rotation.align_vectors(still, centred)[0].as_matrix() @ points.mean(axis=0)


def roots(weight: FloatArray, precision: FloatArray | None) -> FloatArray:
    """Whitening matrices (n, m, 3, 3) of residuals (n, m, 3): W with Wᵀ W the weighted precision."""
    of_one = np.eye(3) if precision is None else np.swapaxes(np.linalg.cholesky(precision), -1, -2)
    return np.sqrt(weight)[..., None, None] * of_one


def first_order(rng, shape, keep):
    """A Markov process (n, …) of variance 1 whose autocorrelation at lag k is keep^k."""
    white = rng.standard_normal(shape)
    if keep == 0:
        return white
    begin = keep * white[:1]
    return np.concatenate([white[:1], lfilter([np.sqrt(1 - keep**2)], [1, -keep], white[1:], axis=0, zi=begin)[0]])


def tracks_of_a_slow_tumble():
    """Five minutes of a body that turns by half a turn: the gravity gradient turns it by less than they show."""
    time = np.arange(0.0, 300.0, 2.0)
    R = attitude(ENVISAT, np.deg2rad([0.5, 0.3, 0.4]), time)
    path = np.tile([4.0, -19.0, 3.0], (len(time), 1))
    return make_case(time, R, path, box_features(8, (4, 3, 2), seed=3), noise=0.03, seed=1).tracks
