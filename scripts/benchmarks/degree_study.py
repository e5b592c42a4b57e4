"""Information criteria for the degree of a polynomial path, compared: the table of docs/theory/pivot.md.

    python scripts/benchmarks/degree_study.py

Random bodies (an axisymmetric free tumble of 0.4 to 15 turns, 4 to 15 features of 10 × 5 × 5 m, 25 to 1200 frames, 1 mm
to 10 cm of noise) on random paths of each kind. "error" is the rms error of the path over that of the best degree, the
geometric mean over the cases; "wrong" the share of cases whose error at the first, middle or last frame has a
probability below 1e-3 by the covariance.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.degree import HIGHEST_CHOSEN, Criterion, akaike_unbiased, choose_degree
from baryscope.estimator.registration.clusters import find_bodies
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_path

FloatArray = NDArray[np.float64]

CASES = 150  # of each kind of path
SEMI_MAJOR_AXIS = 7150e3  # m
DOUBTFUL = float(chi2.isf(1e-3, 3))


def _per_unknown(cost: Callable[[float], float]) -> Criterion:
    return lambda values, squares, unknowns: values * np.log(squares) + cost(values) * unknowns


def _corrected(values: float, squares: FloatArray, unknowns: FloatArray) -> FloatArray:
    return akaike_unbiased(values, squares, unknowns) + values * np.log(np.maximum(values - unknowns, 1.0))


CRITERIA: dict[str, Criterion] = {
    "AIC, 2 an unknown": _per_unknown(lambda values: 2.0),
    "AICc, about 2": _corrected,
    "AICu, about 3": akaike_unbiased,
    "Hannan–Quinn, 2 ln ln n": _per_unknown(lambda values: 2 * np.log(np.log(values))),
    "BIC, ln n": _per_unknown(lambda values: float(np.log(values))),
}


@dataclass(frozen=True, eq=False)
class Case:
    """Tracks, and the true path (n, 3) in m."""

    tracks: FeatureTracks
    path: FloatArray


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def polynomial(rng: np.random.Generator, count: int, noise: float) -> FloatArray:
    """A path (count, 3) in m of degree 0 to 3 with terms of 0.3 to 30 times the noise."""
    s = np.linspace(-1, 1, count)
    terms = np.polynomial.legendre.legvander(s, int(rng.integers(0, 4)))[:, 1:]
    return np.asarray(terms @ rng.normal(size=(terms.shape[1], 3)) * noise * _between(rng, 0.3, 30))


def swing(rng: np.random.Generator, count: int, noise: float) -> FloatArray:
    """A path (count, 3) in m that swings 0.15 to 2 times on each axis, by 1 to 100 times the noise."""
    s = np.linspace(-1, 1, count)[:, None]
    turns = np.exp(rng.uniform(np.log(0.15), np.log(2.0), 3))
    swung = np.sin(np.pi * turns * s + rng.uniform(0, 2 * np.pi, 3))
    return np.asarray(swung * rng.normal(size=3) * noise * _between(rng, 1, 100))


def relative_orbit(rng: np.random.Generator, count: int, noise: float) -> FloatArray:
    """A path (count, 3) in m over 0.01 to 1.1 orbits, a chaser 5 to 40 m away on V-bar, or drifting anywhere."""
    eccentricity = float(rng.choice([0, 0.001, 0.1, 0.5]))
    orbit = Orbit(
        semi_major_axis=SEMI_MAJOR_AXIS / (1 - eccentricity),
        eccentricity=eccentricity,
        inclination=float(rng.uniform(0, np.pi)),
        true_anomaly=float(rng.uniform(0, 2 * np.pi)),
    )
    place, drift = np.array([0.0, -1.0, 0.0]), np.zeros(3)
    if rng.uniform() < 0.5:
        place, drift = rng.normal(size=3), rng.normal(size=3) * rng.choice([0, 1e-3, 2e-2])
    place *= rng.uniform(5, 40) / np.linalg.norm(place)
    time = np.linspace(0, _between(rng, 0.01, 1.1) * orbit.period, count)
    rho = relative_path(orbit, np.concatenate([place, drift]), time)[:, :3]
    return np.asarray(-(lvlh_attitude(orbit, time) @ rho[:, :, None])[:, :, 0])


PATHS = {"polynomials of degree 0–3": polynomial, "swings": swing, "relative orbits": relative_orbit}


def drawn(path: Callable[[np.random.Generator, int, float], FloatArray], seed: int) -> Case:
    """A random case with this kind of path."""
    rng = np.random.default_rng(seed)
    count, features = round(_between(rng, 25, 1200)), int(rng.integers(4, 16))
    noise, turns = _between(rng, 1e-3, 0.1), _between(rng, 0.4, 15)
    com = np.array([4.0, -19.0, 3.0]) + path(rng, count, noise)
    # A free axisymmetric body turns evenly about its axis, and that about the angular momentum.
    phase = 2 * np.pi * turns * np.linspace(0, 1, count)
    nutation, ratio = np.arccos(rng.uniform(0.2, 0.9)), rng.uniform(-1, 1)
    tumble = Rotation.from_euler("ZYZ", np.stack([phase, np.full(count, nutation), ratio * phase], axis=1))
    points = rng.uniform(-0.5, 0.5, (features, 3)) * [10, 5, 5] + rng.normal(size=3) * [1, 0.5, 0.5]
    position = com[:, None] + np.einsum("nij,mj->nmi", (Rotation.random(rng=rng) * tumble).as_matrix(), points)
    position = position + noise * rng.standard_normal(position.shape)
    labels = tuple(f"F{index}" for index in range(features))
    return Case(FeatureTracks(np.arange(float(count)), position, labels), com)


def judged(case: Case) -> tuple[FloatArray, NDArray[np.bool_]]:
    """At each degree up to HIGHEST_CHOSEN or as far as can be done: rms error in m, and whether the answer is wrong."""
    errors, wrong = [], []
    for degree in range(HIGHEST_CHOSEN + 1):
        try:
            found = estimate(case.tracks, options=PathOptions(trajectory=f"polynomial:{degree}"))
        except ComputationError:
            break
        error, ends = found.position - case.path, [0, len(case.path) // 2, -1]
        covariance = cast(FloatArray, found.covariance)  # of `pivot`, which always has one
        nees = [error[end] @ np.linalg.solve(covariance[end], error[end]) for end in ends]
        errors.append(np.sqrt(np.mean(np.sum(error**2, axis=1))))
        wrong.append(bool(max(nees) > DOUBTFUL))
    return np.array(errors), np.array(wrong)


def chosen(case: Case, criterion: Criterion) -> int:
    """The degree by a criterion."""
    tracks = case.tracks
    registered = find_bodies(tracks.position, tracks.seen)
    span = (float(tracks.time[0]), float(tracks.time[-1]))
    return choose_degree(registered, observations_of(tracks, tracks.seen), tracks.time, span, criterion)


def table(cases: int) -> str:
    """The table in Markdown, of so many cases of each kind."""
    rows = {name: [name] for name in CRITERIA}
    for path in PATHS.values():
        costs: dict[str, list[tuple[float, bool]]] = {name: [] for name in CRITERIA}
        for seed in range(cases):
            case = drawn(path, seed)
            errors, wrong = judged(case)
            for name, criterion in CRITERIA.items():
                degree = chosen(case, criterion)
                costs[name].append((float(np.log(errors[degree] / errors.min())), bool(wrong[degree])))
        for name, cost in costs.items():
            log_ratio, share = np.mean(np.array(cost), axis=0)
            rows[name] += [f"{np.exp(log_ratio):.2f}", f"{100 * share:.1f} %"]
    heads = ["criterion and its penalty"] + [f"{kind}, {what}" for kind in PATHS for what in ("error", "wrong")]
    lines = [heads, ["---"] + ["---:"] * (len(heads) - 1), *rows.values()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    print(table(int(sys.argv[1]) if len(sys.argv) > 1 else CASES))
