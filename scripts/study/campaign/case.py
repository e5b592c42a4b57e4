"""One draw of a campaign: fly a scenario with random attitude and noise, estimate, and compare with truth and bound.

`run_one` is pure but for the wall times, which stand apart: equal cases give equal lines, in whatever process.
"""

import time as clock
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.methods import estimate
from baryscope.estimator.prose import verdict
from baryscope.estimator.result import Estimate
from baryscope.models.errors import ComputationError, DiskError, InputError
from baryscope.models.scenario import Outliers, Scenario
from baryscope.models.scenario.orbit import degrees_of
from baryscope.study.campaign.vary import ANOMALY, Values, with_values
from baryscope.study.flight import Flight, fly
from baryscope.study.methods import options_of

FloatArray = NDArray[np.float64]
T = TypeVar("T")


@dataclass(frozen=True)
class Case:
    """One draw: the scenario as data, and all that the draw depends on.

    vary: some of VARIED. unit: an FMU for as many features; built for the draw unless given. values: of fields that are
    drawn over ranges, which `prepared` has made ready. plan: the hash of the plan that the line is of.
    """

    scenario: dict[str, Any]
    number: int
    seed: int
    methods: tuple[str, ...]
    vary: tuple[str, ...]
    unit: str = ""
    values: Values = ()
    plan: str = ""


def drawn(case: Case) -> Scenario:
    """The scenario of a draw, with its attitude, its true anomaly (if the case varies them) and the seed of its noise.

    They come from SeedSequence([seed, number]) alone: a draw of one scenario and that of the same number of another
    have the same attitude and the same noise. Attitudes are uniform over all rotations. The angular rate is that of
    the scenario in body axes, so the angular momentum points anywhere. Values over ranges are the plan's.

    Raises:
        InputError: the scenario does not allow the draw.
    """
    of_attitude, of_anomaly, of_noise = np.random.SeedSequence([case.seed, case.number]).spawn(3)
    quaternion = np.random.default_rng(of_attitude).standard_normal(4)
    anomaly = 360.0 * np.random.default_rng(of_anomaly).random()
    varied = with_values(case.scenario, case.values)
    data = {name: dict(value) if isinstance(value, dict) else value for name, value in varied.items()}
    if "attitude" in case.vary:
        data["target"]["attitude"] = (quaternion / np.linalg.norm(quaternion)).tolist()
    if "anomaly" in case.vary:
        data["orbit"]["true_anomaly_deg"] = float(anomaly)
    data["run"] = data.get("run", {}) | {"seed": int(of_noise.generate_state(1, np.uint32)[0])}
    return Scenario.parse(data, f"{case.scenario['name']}, draw {case.number}")


def run_one(case: Case) -> dict[str, Any]:
    """The line of a draw: errors in m of each method, the RMSE it predicts, NEES; the bound; or why there is none.

    Failures are values here, so that one draw cannot end a campaign. A full disk is none: it says nothing of the draw.

    Raises:
        DiskError: there is no room for the unit's files.
    """
    wall: dict[str, float] = {}
    line: dict[str, Any] = {"plan": case.plan, "seed": case.seed, "scenario": case.scenario["name"]}
    line |= {"case": case.number, "varied": dict(case.values)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scenario, failure = _attempt(lambda: drawn(case))
        flight, line["bound"] = None, {}
        if scenario is not None:
            if "anomaly" in case.vary:
                line["varied"][ANOMALY] = degrees_of(scenario.orbit.true_anomaly)
            begin = clock.perf_counter()
            flight, failure = _attempt(lambda: fly(scenario, Path(case.unit) if case.unit else None))
            wall["flight"] = clock.perf_counter() - begin
            line["bound"] = _bounds(scenario)
            wall["bound"] = clock.perf_counter() - begin - wall["flight"]
        if flight is None or scenario is None:
            line["methods"] = {label: {"failure": failure} for label in case.methods}
        else:
            line["methods"] = {label: _judged(label, scenario, flight, wall) for label in case.methods}
    if caught:
        line["warnings"] = sorted({f"{item.category.__name__}: {item.message}" for item in caught})
    return line | {"wall": wall}


def _attempt(work: Callable[[], T]) -> tuple[T | None, str]:
    """What the work gives, or why it could not be done."""
    try:
        return work(), ""
    except DiskError:
        raise
    except (ComputationError, InputError) as error:
        return None, str(error)
    except Exception as error:
        return None, f"internal error, {type(error).__name__}: {error}"


def _bounds(scenario: Scenario) -> dict[str, Any]:
    """The bound on the RMSE of the path and of the CoM in body axes, m; path_rmse_clean: without any outliers."""
    bound, reason = _attempt(lambda: cramer_rao_bound(scenario))
    if bound is None:
        return {"failure": reason}
    clean = bound
    if scenario.sensor.outliers != Outliers():
        sensor = scenario.sensor.model_copy(update={"outliers": Outliers()})
        clean = cramer_rao_bound(scenario.model_copy(update={"sensor": sensor}))
    return {
        "path_rmse": bound.position_deviation,
        "path_rmse_clean": clean.position_deviation,
        "body_rmse": bound.offset_deviation,
        "verdict": verdict(bound.observability),
    }


def _judged(label: str, scenario: Scenario, flight: Flight, wall: dict[str, float]) -> dict[str, Any]:
    """How well one method did."""
    method, options = options_of(label)
    begin = clock.perf_counter()
    result, failure = _attempt(
        lambda: estimate(flight.tracks, method=method, orbit=scenario.orbit.of_simulation(), options=options)
    )
    wall[label] = clock.perf_counter() - begin
    if result is None:
        return {"failure": failure}
    error = result.position - flight.true_path
    distance = np.linalg.norm(error, axis=1)
    judged = {
        "rmse": _finite(np.sqrt(np.mean(distance**2))),
        "max_error": _finite(distance.max()),
        "predicted_rmse": _finite(result.predicted_rmse),
        "nees": None if result.covariance is None else _nees(error, result.covariance),
        "trustworthy": None if result.covariance is None else result.status.trustworthy,
        "rejected_share": result.rejected_share,
    }
    if judged["rmse"] is None:
        return judged | {"failure": "gave a path that is not finite"}
    in_body, _ = _attempt(lambda: _in_body_axes(result, scenario))
    return judged | (in_body or {})


def _finite(value: Any) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None


def _nees(error: FloatArray, covariance: FloatArray) -> list[float | None]:
    """eᵀ P⁻¹ e at the first, the middle and the last frame, each of three degrees of freedom."""
    n = len(error)
    return [_normalised(error[k], covariance[k]) for k in (0, n // 2, n - 1)]


def _normalised(error: FloatArray, covariance: FloatArray) -> float | None:
    try:
        return _finite(error @ np.linalg.solve(covariance, error))
    except np.linalg.LinAlgError:
        return None


def _in_body_axes(result: Estimate, scenario: Scenario) -> dict[str, Any]:
    """Error (m) and NEES of the CoM in the axes that the features of the longest cluster hold; nothing if not given.

    True and estimated features are laid on each other; what is left between the two CoMs is the error.
    """
    from scipy.spatial.transform import Rotation  # slow to load, and few commands need it

    if result.observability is None:
        return {}
    cluster = result.clusters[result.observability.cluster]
    places = {point.label: point.position for point in scenario.features.points}
    true = np.array([places[label] for label in cluster.labels])
    R, _ = Rotation.align_vectors(cluster.points, true - true.mean(axis=0))
    error = cluster.centre_of_mass - R.apply(-true.mean(axis=0))
    nees = None if cluster.covariance is None else _normalised(error, cluster.covariance)
    return {"body_error": _finite(np.linalg.norm(error)), "body_nees": nees}
