"""One estimate of one case as a line of numbers: status, errors, NEES, definiteness, time, and the bound."""

import time as clock
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator import METHODS, Estimate, Failure, PathOptions, attempt
from baryscope.models.errors import InputError, Reason
from baryscope.study.population.ahead import Asked, asked_of, predicted
from baryscope.study.population.consistency import WRONG, definite, nees
from baryscope.study.population.information import Watched, path_bound, polynomial_jacobian, polynomial_misfit, rms
from baryscope.study.population.interface import Drawn, Sample
from baryscope.study.population.populations import FIRST, POPULATIONS
from baryscope.study.population.running import Line

FloatArray = NDArray[np.float64]

CRASHED = "crashed:"  # begins the message of a failure that is no reasoned refusal
HIGHEST = 20  # degree of a polynomial


@lru_cache(maxsize=1)
def prepared(seed: int, index: int, population: str = FIRST) -> tuple[Drawn, Sample, Line]:
    """A case of a population, its sample, and what every line about it says."""
    case, sampler = POPULATIONS[population](seed, index)
    sample = sampler(0)
    facts = {
        "kind": case.kind,
        "frames": len(case.time),
        "features": len(case.points),
        "span": float(case.time[-1] - case.time[0]),
        "rotations": round(case.rotations, 2),
        "noise": case.noise,
        "radius": case.radius,
        "bounds": bounds_of(case, sample),
    }
    return case, sample, facts


def bounds_of(case: Drawn, sample: Sample) -> dict[str, float]:
    """Bounds on the path's rms error, m: with free attitudes and a free tumble, with the orbit and without.

    Without it the path is the polynomial of lowest degree that departs from the truth by a third of its bound.
    """
    free = Watched(case.attitude, case.points, sample.precision, sample.right)
    tumble = replace(free, turn=case.turn)
    found = {
        "free orbit": rms(path_bound(case.path_jacobian, free)),
        "tumble orbit": rms(path_bound(case.path_jacobian, tumble)),
    }
    for degree in range(HIGHEST + 1):
        jacobian = polynomial_jacobian(case.time, degree)
        misfit = polynomial_misfit(case.time, case.path, degree)
        if misfit > 1.0 and degree < HIGHEST:
            continue
        bound = rms(path_bound(jacobian, free))
        if misfit < bound / 3:
            return found | {"free": bound, "tumble": rms(path_bound(jacobian, tumble)), "degree": degree}
    return found


@lru_cache(maxsize=1)
def asked(seed: int, index: int, population: str = FIRST) -> Asked:
    """What is asked of predictions in a case."""
    case, sample, _ = prepared(seed, index, population)
    return asked_of(case, sample)


def judged(seed: int, index: int, method: str, orbit: bool, population: str = FIRST, ahead: bool = False) -> Line:
    """The line of an estimate: its failure, or status, errors and NEES at the first, middle and last time.

    It names the population unless that is the first. ahead: it has predictions, too, see `ahead.predicted`.
    Of a target that does not fly none is made with an orbit: the line says `skipped`.
    """
    case, sample, facts = prepared(seed, index, population)
    line: Line = {"seed": seed, "index": index, "method": method, "orbit": orbit}
    if population != FIRST:
        line["population"] = population
    if ahead:
        line["ahead"] = True
    if orbit and not case.orbital:
        return line | {"skipped": "no orbit"}
    with measured(line):
        found = tried(case, sample, method, orbit)
    if ahead and isinstance(found, Estimate) and found.predictor is not None:
        try:
            line["predicted"] = predicted(found, asked(seed, index, population))
        except Exception as error:
            found = crash(method, error)
    if isinstance(found, Estimate):
        line |= of_estimate(found, case.path)
    else:
        line |= {"failure": found.reason, "message": found.message}
    return line | facts


@contextmanager
def measured(line: Line) -> Iterator[None]:
    """Puts the time that the work within takes into a line, in s, and the warnings it gives."""
    begin = clock.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    line["wall"] = round(clock.perf_counter() - begin, 3)
    if caught:
        line["warnings"] = sorted({f"{item.category.__name__}: {item.message}" for item in caught})


def tried(case: Drawn, sample: Sample, method: str, orbit: bool) -> Estimate | Failure:
    """An estimate, or the failure, even one that is no reasoned refusal."""
    options = METHODS[method].options()
    if isinstance(options, PathOptions) and case.told is not None:
        options = PathOptions(sigma=case.told)
    try:
        return attempt(sample.tracks, method=method, orbit=case.orbit if orbit else None, options=options)
    except InputError as error:
        return Failure(method, Reason.OTHER, str(error))  # of tracks that are no input, with what was expected
    except Exception as error:
        return crash(method, error)


def crash(method: str, error: Exception) -> Failure:
    """The failure of a method by an error that is no reasoned refusal."""
    return Failure(method, Reason.OTHER, f"{CRASHED} {type(error).__name__}: {error}")


def of_estimate(found: Estimate, truth: FloatArray) -> Line:
    """What an estimate claims of a path (n, 3) in C, and how far it is off."""
    line: Line = {
        "status": str(found.status),
        "announced": not found.status.trustworthy,
        "findings": [f"{type(item).__name__} {_short(asdict(item))}" for item in found.findings],
        "path": found.path,
        "rounds": found.rounds,
        "sigma": found.noise.a_posteriori,
        "rejected": found.rejected_share,
    }
    if found.covariance is not None:
        bodies = [cluster.covariance for cluster in found.clusters if cluster.covariance is not None]
        line["predicted_rmse"] = found.predicted_rmse
        line["definite"] = definite(found.covariance) and all(map(definite, bodies))
    return line | accuracy(found.position, found.covariance, truth)


def accuracy(position: FloatArray, covariance: FloatArray | None, truth: FloatArray) -> Line:
    """Errors of a path (n, 3), at the first, middle and last time and as their rms, and what is claimed there."""
    error, places = position - truth, [0, len(truth) // 2, len(truth) - 1]
    line: Line = {
        "error": [float(np.linalg.norm(error[k])) for k in places],
        "rmse": float(np.sqrt((error**2).sum(axis=1).mean())),
    }
    if covariance is not None:
        line["nees"] = [nees(error[k], covariance[k]) for k in places]
        line["claimed"] = [float(np.sqrt(max(np.trace(covariance[k]), 0))) for k in places]
    return line


def wrong(line: Line) -> bool:
    """Whether one of the errors of an answer is beyond its covariance, with p < 0.001."""
    return not all(value <= WRONG for value in line["nees"])


def _short(fields: Line) -> str:
    return ", ".join(f"{k}={v:.3g}" if isinstance(v, float) else f"{k}={v}" for k, v in fields.items())
