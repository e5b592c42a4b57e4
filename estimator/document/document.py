"""What the document of an estimate says: everything except its series over time."""

import re
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from baryscope.estimator.document.details import details_part, plain
from baryscope.estimator.document.schema import (
    AxesPart,
    ClusterPart,
    EstimateDocument,
    FindingPart,
    ForcePart,
    Interval,
    NoisePart,
    ObservabilityPart,
    ProcessNoisePart,
    RejectedPart,
)
from baryscope.estimator.findings import Finding
from baryscope.estimator.observability import Observability, PrincipalAxes
from baryscope.estimator.prose import sentence, verdict
from baryscope.estimator.registration.intervals import runs_of
from baryscope.estimator.result import Cluster, Estimate, ProcessNoise
from baryscope.estimator.thrust import KnownAcceleration


def document_of(result: Estimate) -> EstimateDocument:
    """The document of an estimate: everything except its series over time."""
    return EstimateDocument(
        version=result.version,
        epoch=result.epoch,
        method=result.method,
        status=result.status,
        path=result.path,
        options={field.name: _option(getattr(result.options, field.name)) for field in fields(result.options)},
        converged=result.converged,
        rounds=result.rounds,
        coverage=result.coverage,
        predicted_rmse=plain(result.predicted_rmse),
        noise=NoisePart(
            a_priori=result.noise.a_priori,
            a_posteriori=result.noise.a_posteriori,
            unit="1" if result.noise.relative else "m",
            lasting=result.noise.lasting,
        ),
        process_noise=None if result.process_noise is None else _process_noise(result.process_noise),
        observability=None if result.observability is None else _observability(result.observability),
        clusters=tuple(_cluster(cluster, result) for cluster in result.clusters),
        residual_rms={
            label: plain(value) for label, value in zip(result.labels, result.feature_rms.tolist(), strict=True)
        },
        rejected=RejectedPart(
            share=result.rejected_share, features=result.rejected_features, intervals=rejected_intervals(result)
        ),
        forces=tuple(ForcePart.model_validate(asdict(force)) for force in result.forces),
        findings=tuple(_finding(finding) for finding in result.findings),
        details=details_part(result.details),
        wall_time=result.wall_time,
    )


def _option(value: Any) -> Any:
    """An option as JSON has it, a known acceleration in words."""
    return str(value) if isinstance(value, KnownAcceleration) else plain(value)


def _axes(axes: PrincipalAxes) -> AxesPart:
    return AxesPart(deviations=plain(axes.deviations), directions=plain(axes.directions))


def _observability(found: Observability) -> ObservabilityPart:
    first, second, third = found.observable.tolist()
    return ObservabilityPart(
        verdict=verdict(found),
        cluster=found.cluster,
        threshold=found.threshold,
        observable=(first, second, third),
        condition_number=plain(found.condition_number),
        body=_axes(found.body),
        inertial=_axes(found.inertial),
    )


def _cluster(cluster: Cluster, result: Estimate) -> ClusterPart:
    time = result.time
    return ClusterPart(
        start=float(time[cluster.frames[0]]),
        end=float(time[cluster.frames[-1]]),
        frames=len(cluster.frames),
        intervals=tuple((float(time[one.start]), float(time[one.stop - 1])) for one in cluster.intervals),
        features={
            label: plain(point)
            for label, point in zip(cluster.labels, cluster.points, strict=True)
            if np.isfinite(point).all()
        },
        centre_of_mass=plain(cluster.centre_of_mass) if np.isfinite(cluster.centre_of_mass).all() else None,
        centre_of_mass_covariance=plain(cluster.covariance),
    )


def rejected_intervals(result: Estimate) -> dict[str, tuple[Interval, ...]]:
    """For each feature with rejected observations, their intervals from first to last time, s."""
    found = {}
    for index in np.nonzero(result.rejected.any(axis=0))[0]:
        runs = runs_of(result.rejected[:, index])
        found[result.labels[index]] = tuple((float(result.time[a]), float(result.time[b - 1])) for a, b in runs)
    return found


def _process_noise(noise: ProcessNoise) -> ProcessNoisePart:
    return ProcessNoisePart(
        source=noise.source,
        density=noise.density,
        unit="m²" if noise.of_position else "m²/s³",
        bounds=noise.interval,
        significance=plain(noise.significance),
        displacement=plain(noise.displacement),
    )


def kind_of(finding: type[Finding]) -> str:
    """The kind of a finding, as the document names it: lack-of-fit of LackOfFit."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "-", finding.__name__).lower()


def _finding(finding: Finding) -> FindingPart:
    own = {"kind": kind_of(type(finding)), "text": sentence(finding)}
    return FindingPart.model_validate(own | asdict(finding))
