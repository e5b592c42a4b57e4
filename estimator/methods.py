"""The list of all methods, for the command line and the tests, and the functions that call them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.claims import claimed
from baryscope.estimator.consider import considered
from baryscope.estimator.ekf.method import estimate_by_filter
from baryscope.estimator.findings import HeldFrames, OtherBody
from baryscope.estimator.geometry.symmetric import made_definite
from baryscope.estimator.ml.method import estimate_by_likelihood
from baryscope.estimator.noise.following import with_noise_as_shown
from baryscope.estimator.noise.held import held_frames
from baryscope.estimator.noise.moving import without_moving_features
from baryscope.estimator.options import Options, PathOptions, ScrewOptions
from baryscope.estimator.pivot.method import estimate_by_pivot
from baryscope.estimator.plausibility import refuse_implausible
from baryscope.estimator.progress import Progress, silent
from baryscope.estimator.prose import sentence
from baryscope.estimator.registration.screening import bodies_beside
from baryscope.estimator.result import Estimate
from baryscope.estimator.score import estimate_by_score
from baryscope.estimator.screws import gpa, least_squares, raw
from baryscope.estimator.screws.pipeline import estimate_by_screws
from baryscope.estimator.screws.stages import ScrewFunction
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.arguments import instance_of
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit


@dataclass(frozen=True)
class Method:
    """A method: its name on the command line, a summary in one line, the type of its options, and its function.

    predicts: its results tell the centre of mass at other times; tumble: it estimates a free tumble, and so predicts
    points of the body, too; camera_errors: it estimates them beside the path, so that its covariance has them.
    """

    name: str
    summary: str
    options: type[Options]
    run: Callable[[FeatureTracks, Orbit | None, Any, Progress], Estimate]
    predicts: bool = False
    tumble: bool = False
    camera_errors: bool = False

    def __call__(
        self,
        tracks: FeatureTracks,
        *,
        orbit: Orbit | None = None,
        options: Options | None = None,
        progress: Progress = silent,
    ) -> Estimate:
        """Estimate the path of the centre of mass; see `estimate`."""
        chosen = self.options() if options is None else options
        if not isinstance(chosen, self.options):
            raise InputError(f"{self.name} takes {self.options.__name__}, found {type(chosen).__name__}")

        def fit(own: FeatureTracks, told: Options) -> Estimate:
            return self.run(own, orbit, told, progress)

        if isinstance(chosen, PathOptions):
            found = without_moving_features(lambda own: with_noise_as_shown(fit, own, chosen), tracks)
            found = replace(found, findings=found.findings + _other_bodies(tracks))
        else:
            found = fit(tracks, chosen)
        found = claimed(found if self.camera_errors else considered(found, tracks), tracks)
        covariance = None if found.covariance is None else made_definite(found.covariance)
        return replace(found, covariance=covariance, epoch=tracks.epoch or (None if orbit is None else orbit.epoch))


def _other_bodies(tracks: FeatureTracks) -> tuple[OtherBody, ...]:
    """The findings of rigid bodies beside the one that is estimated."""
    groups = bodies_beside(tracks.position, tracks.seen)
    return tuple(OtherBody(tuple(tracks.labels[index] for index in group)) for group in groups)


def _at_once(run: Callable[[FeatureTracks, Orbit | None, Any], Estimate]) -> Callable[..., Estimate]:
    """A method that reports no progress, with the signature of those that do."""

    def with_progress(tracks: FeatureTracks, orbit: Orbit | None, options: Any, _: Progress) -> Estimate:
        return run(tracks, orbit, options)

    return with_progress


def _by_screws(name: str, summary: str, screws: ScrewFunction) -> Method:
    return Method(name, summary, ScrewOptions, _at_once(partial(estimate_by_screws, name, screws)))


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        _by_screws("screw-raw", "three-point Reuleaux on raw points", raw.screws),
        _by_screws("screw-ls", "least-squares screws of all features (CasADi)", least_squares.screws),
        _by_screws("screw-gpa", "screws of Procrustes-registered poses, as published", gpa.screws),
        Method(
            "pivot",
            "drifting pivot: least squares of path and points, attitudes free",
            PathOptions,
            _at_once(estimate_by_pivot),
            predicts=True,
            camera_errors=True,
        ),
        Method(
            "ml",
            "maximum a posteriori: path, points and free tumble at once, weak prior on inertia and path",
            PathOptions,
            estimate_by_likelihood,
            predicts=True,
            tumble=True,
            camera_errors=True,
        ),
        Method(
            "ekf",
            "iterated extended Kalman filter, tuned and smoothed",
            PathOptions,
            estimate_by_filter,
            predicts=True,
            tumble=True,
            camera_errors=True,
        ),
        Method("score", "symmetrical centre of rotation (SCoRE), at rest", PathOptions, _at_once(estimate_by_score)),
    )
}
"""All methods by their names on the command line, in the order of its tables."""


PREDICTING = tuple(name for name, method in METHODS.items() if method.predicts)
"""The methods whose results predict the centre of mass at other times, see `Estimate.predict`."""

TURNING = tuple(name for name, method in METHODS.items() if method.tumble)
"""Those that predict points of the body, too, by its tumble; the others leave the attitudes free."""

CLAIMING = tuple(name for name, method in METHODS.items() if method.options is PathOptions)
"""Those whose results have a covariance."""


@dataclass(frozen=True)
class Failure:
    """The reason why a method has no estimate, as a value and in a sentence."""

    method: str
    reason: Reason
    message: str


def attempt(
    tracks: FeatureTracks,
    *,
    method: str = "pivot",
    orbit: Orbit | None = None,
    options: Options | None = None,
    camera: Camera | None = None,
    progress: Progress = silent,
) -> Estimate | Failure:
    """As `estimate`, but returns a Failure instead of raising a ComputationError.

    Raises:
        InputError: an unknown method, an invalid combination of options, or tracks that are not of one body in metres.
    """
    try:
        return estimate(tracks, method=method, orbit=orbit, options=options, camera=camera, progress=progress)
    except ComputationError as error:
        return Failure(method, error.reason, str(error))


def estimate(
    tracks: FeatureTracks,
    *,
    method: str = "pivot",
    orbit: Orbit | None = None,
    options: Options | None = None,
    camera: Camera | None = None,
    progress: Progress = silent,
) -> Estimate:
    """The path of the centre of mass in C at every time of the tracks, by the method of that name in METHODS.

    options: ScrewOptions for the screw methods, PathOptions for the others. camera: of tracks in camera axes, which it
    turns into C. progress: told the share that is done, by `ml` and `ekf`, which may take long; their rounds are not
    known beforehand, so it is a rough one.

    Raises:
        InputError: an unknown method, an invalid combination of options, or tracks that are not of one body in metres.
        ComputationError: the tracks do not determine the centre of mass; the message says what is missing.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    given: tuple[tuple[str, object, type, str], ...] = (
        ("tracks", tracks, FeatureTracks, "as of read_tracks, tracks_of or tracks_of_dataset"),
        ("orbit", orbit, Orbit, "as of load_orbit"),
        ("camera", camera, Camera, "as of Camera.load"),
    )
    for name, value, kind, source in given:
        if value is not None or name == "tracks":
            instance_of(name, value, kind, source)
    refuse_implausible(tracks, "tracks")
    held = held_frames(tracks)
    if held.any():
        tracks = replace(tracks, position=np.where(held[:, None, None], np.nan, tracks.position))
    tracks = _without_glimpses(tracks)
    if camera is not None:
        tracks = camera.inertial(tracks)
    estimated = partial(METHODS[method], tracks, orbit=orbit, options=options, progress=progress)
    return _without(tracks.time[held], estimated) if held.any() else estimated()


def _without_glimpses(tracks: FeatureTracks) -> FeatureTracks:
    """The tracks without features of a single observation, if there are others: each has a place of its own, and tells
    nothing of what moves. But it would count for the size of the body, and for the degrees of freedom.
    """
    once = np.count_nonzero(tracks.seen, axis=0) == 1
    if once.all() or not once.any():
        return tracks
    return replace(tracks, position=np.where(once[:, None], np.nan, tracks.position))


def _without(held: NDArray[np.float64], estimated: Callable[[], Estimate]) -> Estimate:
    """An estimate, or why there is none, that says that frames at times (k,) are held and left out.

    Raises:
        ComputationError: the other frames do not determine the unknowns.
    """
    left_out = HeldFrames(float(held[0]), float(held[-1]), len(held))
    try:
        found = estimated()
    except ComputationError as error:
        raise ComputationError(f"{error}; {sentence(left_out)}", error.reason) from error
    return replace(found, findings=(*found.findings, left_out))
