"""pivot: the drifting pivot. Bodies from the tracks, one linear least squares, and its refinement with free attitudes.

The attitude of every frame is free, so nothing needs to be known of how the target turns; what is known of the path of
its centre of mass ties the frames together.
"""

import time as clock
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from baryscope.estimator.algebra import symmetric_pseudo_inverse
from baryscope.estimator.assessment import Cluster, assessed, doubtful, missing_covariance
from baryscope.estimator.bodies import PosedBody, find_bodies
from baryscope.estimator.bundle import Body, Solution, improve
from baryscope.estimator.drift import frame_weights, solve_drift
from baryscope.estimator.noise import moved_to, sightings_of
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths import Path, Polynomial, SampledPath, trajectory_of
from baryscope.estimator.result import Estimate
from baryscope.estimator.robust import FAINT, reweighted, screen
from baryscope.estimator.sightings import Sightings, cross_matrices, pieces, symmetric_inverses
from baryscope.estimator.ties import Tie, tie
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from baryscope.models.scenario import Orbit

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ROUNDS = 30
SETTLED = 0.1  # a step this long, squared, in units of the covariance of all unknowns, is the last
# The first step from the linear solution leaves less than this share of its own length, squared: with more frames than
# unknowns by far there is no need for a second one to see it.
CONTRACTION = 1e-5
ROUNDING = 1e-10  # of the distance: residuals smaller than this are none
HASTY = 6  # rounds in which weights may change at will
FOREIGN = 0.01  # of a cubic's size that a path must be unable to follow, to be a departure from it
CHANCE = 1e-7  # of a departure that is none
MISFIT = 1.5  # variance over that of the registration, from which on the path is said not to fit
UNRULY = 1e-2  # share of the cost that the last change of weights may take away
HIGHEST_CHOSEN = 14  # degree of a polynomial that the data may ask for
PATIENCE = 3  # degrees that may fail to be better before the search ends
DEPARTURE_FRAMES = 1500  # frames at most that a departure from the path is looked for in
FEW_FRAMES = 3000  # frames at most, or so, that a start is found by, a degree, and what attitude noise seems to show
LEAST_FRAMES = 20  # of a body, that are not left out for another's sake


@dataclass(frozen=True, eq=False)
class Pivot:
    """What `pivot` finds, for `ml` to start from.

    path and its unknowns x; believed (n, m): which sightings were believed at first; bodies with points seen from the
    centre of mass; sightings with their weights, all (n, m); variance of a sighting of weight 1, as given or as the
    residuals show it, over the given covariance or in m²; residual_variance: as they show it. ties between bodies that
    share features, and those refused because the features differ; remarks: what does not fit.
    """

    path: Path
    sampled: SampledPath
    believed: BoolArray
    solution: Solution
    posed: tuple[PosedBody, ...]
    sightings: Sightings
    variance: float
    residual_variance: float
    converged: bool
    rounds: int
    ties: tuple[Tie, ...]
    refused: tuple[Tie, ...]
    remarks: tuple[str, ...] = ()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, points in m from the centre of mass."""
        return self.solution.bodies


def estimate_by_pivot(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass by the drifting pivot.

    Raises:
        InputError: options that do not go together.
        ComputationError: the tracks do not hold what it takes.
    """
    begin = clock.perf_counter()
    found = solve_pivot(tracks, orbit, options)
    position = found.sampled.position(found.solution.x)
    covariance, offsets = _with_faint_directions(found, position)
    clusters = [
        Cluster(
            features=body.features,
            frames=body.frames,
            intervals=posed.intervals,
            points=body.points,
            covariance=offset,
        )
        for body, posed, offset in zip(found.bodies, found.posed, offsets, strict=True)
    ]
    return assessed(
        "pivot",
        tracks,
        found.path.name,
        position,
        found.sampled.covariance(covariance),
        clusters,
        weights=np.where(
            tracks.seen & ~found.believed, np.maximum(found.sightings.weight, FAINT), found.sightings.weight
        ),
        variance=found.variance,
        options=options,
        begin=begin,
        extra={
            "converged": found.converged,
            "rounds": found.rounds,
            "ties": [_tie_described(tie, tracks.labels) for tie in found.ties],
        },
        remarks=found.remarks,
    )


def _tie_described(made: Tie, labels: tuple[str, ...]) -> dict[str, Any]:
    return {"clusters": list(made.bodies), "features": [labels[index] for index in made.features]}


def solve_pivot(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Pivot:
    """Bodies, path and points at their least squares."""
    trajectory = trajectory_of(options.trajectory, orbit)
    believed = screen(tracks.position, tracks.seen)
    posed, noise = find_bodies(tracks.position, believed)
    measured = sightings_of(tracks, tracks.seen)
    sightings = _restricted(measured, posed, believed)
    span = (float(tracks.time[0]), float(tracks.time[-1]))
    if trajectory.kind == "polynomial" and trajectory.degree is None:
        degree = _choose_degree(posed, sightings, tracks.time, span)
        path: Path = Polynomial(degree, *span)
    else:
        path = trajectory.path(orbit, *span, degree=0)
    frames = sum(len(one.body.frames) for one in posed)
    if 3 * frames <= path.size + 3 * len(posed):
        raise ComputationError(
            f"{frames} frames show an attitude, too few for {path.name}: more than {path.size // 3 + len(posed)} needed"
        )
    sampled = path.at(tracks.time)
    bodies, x = _start(posed, sightings, path, tracks.time)
    found = _refined(path, sampled, bodies, x, posed, measured, sightings, believed, options)
    remarks = [_refusal(tie, tracks.labels) for tie in found.refused]
    ratio = found.residual_variance / max(noise, 1e-300) ** 2
    if found.residual_variance > least_variance(measured, ROUNDING):
        if measured.precision is None and ratio > MISFIT:
            remarks.append(
                f"{path.name} does not fit: residuals are {np.sqrt(ratio):.2g} times those of the bodies alone"
            )
        elif departure := _departure(found, tracks.time):
            remarks.append(departure)
    return replace(found, remarks=tuple(remarks))


def _refusal(tie: Tie, labels: tuple[str, ...]) -> str:
    """A remark that features of one name are not the same points."""
    names, (first, second) = ", ".join(labels[index] for index in tie.features), tie.bodies
    by = "it" if len(tie.features) == 1 else "them"
    return f"{names}: not the same in clusters {first} and {second}, which are not tied by {by}"


def _departure(found: Pivot, time: FloatArray) -> str | None:
    """A remark if the CoM departs from its kind of path by more than noise explains: by a cubic in time, added to it.

    Only what the path itself cannot do is added. Where there is no departure, the gain in cost of these k unknowns is
    χ² distributed with k degrees of freedom; where a direction is hardly seen noise may gain more: nothing is said.
    """
    posed = tuple(replace(one, body=body) for one, body in zip(found.posed, found.bodies, strict=True))
    thinned, few, rows = _thinned(posed, found.sightings, DEPARTURE_FRAMES)
    bodies, x = tuple(one.body for one in thinned), found.solution.x
    own = found.sampled.jacobian[rows]
    cubic = Polynomial(3, float(time[0]), float(time[-1])).at(time[rows]).jacobian
    known, added = own.reshape(3 * len(rows), -1), cubic.reshape(3 * len(rows), -1)
    added = added - known @ (symmetric_pseudo_inverse(known.T @ known) @ (known.T @ added))
    squares, axes = np.linalg.eigh(added.T @ added)
    size = np.linalg.norm(cubic, axis=(0, 1)).max()
    new = added @ axes[:, squares > (FOREIGN * size) ** 2] / size
    if not new.shape[1]:
        return None
    position, new = found.sampled.position(x)[rows], np.sqrt(len(rows)) * new.reshape(len(rows), 3, -1)
    wider = SampledPath(np.concatenate([own, new], axis=2), lambda y: position + new @ y[len(x) :])
    start = np.concatenate([x, np.zeros(new.shape[2])])
    freed, held = improve(bodies, few, wider, start), improve(bodies, few, SampledPath(own, lambda _: position), x)
    gain = (freed.step - held.step) / found.variance
    if chi2.sf(gain, new.shape[2]) > CHANCE or _is_faint(found):
        return None
    metres = float(wider.lengths((freed.x - start)[:, None])[0])
    return f"the path departs from {found.path.name} by {metres:.2g} m or so (χ² {gain:.0f}, expected {new.shape[2]})"


def _is_faint(found: Pivot) -> bool:
    """Whether the CoM is hardly seen in some direction in which a body's offset lies."""
    widened = _with_faint_directions(found, found.sampled.position(found.solution.x))[1]
    before = found.variance * _diagonal_blocks(found.solution.offset_covariance)
    return bool(np.any(np.trace(widened, axis1=1, axis2=2) > 1.5 * np.trace(before, axis1=1, axis2=2)))


def least_variance(sightings: Sightings, rounding: float) -> float:
    """Of a sighting of weight 1, that of rounding to this share of the farthest distance."""
    if sightings.precision is not None:
        return 1e-9
    position = sightings.position
    return rounding**2 * float(np.einsum("kmi,kmi->km", position, position).max(initial=0.0))


def _restricted(measured: Sightings, posed: tuple[PosedBody, ...], believed: BoolArray) -> Sightings:
    """Only what some body could explain; what is not believed keeps a faint weight, so that its residual is seen."""
    weight = np.zeros_like(measured.weight)
    for one in posed:
        block = np.ix_(one.body.frames, one.body.features)
        weight[block] = measured.weight[block] * np.where(believed[block], 1.0, FAINT)
    return measured.weighted(weight)


def _start(
    posed: tuple[PosedBody, ...], sightings: Sightings, path: Path, time: FloatArray
) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies and path to refine: by linear least squares; of many frames, some are solved, and refined once."""
    thinned, few, rows = _thinned(posed, sightings, FEW_FRAMES)
    sampled = path.at(time[rows])
    bodies, x = _linear(thinned, few, sampled)
    if len(rows) < sum(len(one.body.frames) for one in posed):
        solution = improve(bodies, few, sampled, x)
        bodies, x = solution.bodies, solution.x
    return tuple(replace(one.body, points=body.points) for one, body in zip(posed, bodies, strict=True)), x


def _linear(
    posed: tuple[PosedBody, ...], sightings: Sightings, sampled: SampledPath
) -> tuple[tuple[Body, ...], FloatArray]:
    """The path and the bodies seen from the centre of mass, by linear least squares, weighted the second time."""
    first = solve_drift(posed, [np.ones(len(one.body.frames)) for one in posed], sampled)
    drift = solve_drift(posed, frame_weights(posed, sightings.weight, first.offsets), sampled)
    moved = zip(posed, drift.offsets, strict=True)
    return tuple(replace(one.body, points=one.body.points + offset) for one, offset in moved), drift.x


def _refined(
    path: Path,
    sampled: SampledPath,
    bodies: tuple[Body, ...],
    x: FloatArray,
    posed: tuple[PosedBody, ...],
    measured: Sightings,
    sightings: Sightings,
    believed: BoolArray,
    options: PathOptions,
) -> Pivot:
    converged, rounds, variance, floor = False, 0, np.nan, least_variance(measured, ROUNDING)
    while not converged and rounds < ROUNDS:
        rounds += 1
        if measured.precision is not None and options.noise == "stereo":
            sightings = moved_to(sightings, measured, _points_in_C(bodies, sampled.position(x), measured))
        solution = improve(bodies, sightings, sampled, x)
        bodies, x = solution.bodies, solution.x
        freedom = _freedom(bodies, sightings, len(x))
        cost = float(solution.squares.sum())
        variance = cost / freedom
        weight = reweighted(solution.squares, sightings.weight, freedom, floor)
        if rounds > HASTY:  # weights that swing to and fro come to rest in between
            weight = np.sqrt(weight * sightings.weight)
        least = max(variance, floor)
        short = solution.step <= SETTLED * least
        if rounds == 1 and measured.precision is None:
            short = CONTRACTION * solution.step <= SETTLED * least
        plain = solution.squares / np.where(weight > 0, sightings.weight, 1.0)
        converged = short and abs(float(np.vdot(plain, weight)) - cost) <= UNRULY * max(cost, floor * freedom)
        sightings = sightings.weighted(weight)
    scale = options.sigma**2 if options.sigma is not None else variance
    solution, ties, strangers = tie(solution, max(scale, floor))
    return Pivot(
        path, sampled, believed, solution, posed, sightings, scale, variance, converged, rounds, ties, strangers
    )


def _freedom(bodies: tuple[Body, ...], sightings: Sightings, path_size: int) -> float:
    """Values less unknowns, where a frame's rotation takes three, and a body's points three each but for its turn."""
    frames = sum(len(body.frames) for body in bodies)
    points = sum(3 * len(body.features) - 3 for body in bodies)
    freedom = 3 * float(sightings.weight.sum()) - 3 * frames - points - path_size
    if freedom <= 0:
        raise ComputationError(
            f"{frames} frames that show an attitude, with {sightings.count} sightings, are too few for a path of "
            f"{path_size} unknowns"
        )
    return freedom


def _points_in_C(bodies: tuple[Body, ...], origin: FloatArray, measured: Sightings) -> FloatArray:
    """Where the points are estimated to be, (n, m, 3) in C; where they were measured if no body has them."""
    estimated = measured.position.copy()
    for body in bodies:
        image = body.points @ np.swapaxes(body.attitude, 1, 2) + origin[body.frames][:, None]
        estimated[np.ix_(body.frames, body.features)] = image
    return estimated


def _choose_degree(
    posed: tuple[PosedBody, ...], sightings: Sightings, time: FloatArray, span: tuple[float, float]
) -> int:
    """The degree of a polynomial by Akaike's criterion, from the lowest up until it fails to improve.

    Each degree is refined with free attitudes: with the attitudes held, their noise alone would favour high degrees,
    which shrink the offsets that it is multiplied by.
    """
    thinned, few, rows = _thinned(posed, sightings, FEW_FRAMES)
    best, degree_of_best = np.inf, 0
    for degree in range(HIGHEST_CHOSEN + 1):
        if degree > degree_of_best + PATIENCE:
            break
        sampled = Polynomial(degree, *span).at(time[rows])
        bodies, x = _linear(thinned, few, sampled)
        for _ in range(3):
            solution = improve(bodies, few, sampled, x)
            bodies, x = solution.bodies, solution.x
        freedom = _freedom(bodies, few, len(x))
        values = freedom + len(x)
        # Akaike's criterion for Gaussian noise of unknown size.
        criterion = values * np.log(max(float(solution.squares.sum()), 1e-300) / freedom) + 2 * len(x)
        if criterion < best:
            best, degree_of_best = criterion, degree
    return degree_of_best


def _thinned(
    posed: tuple[PosedBody, ...], sightings: Sightings, most: int
) -> tuple[tuple[PosedBody, ...], Sightings, IntArray]:
    """Bodies and sightings in `most` of their frames or a few more, and which these are, (k,): of each body some."""
    every = max(1, sum(len(one.body.frames) for one in posed) // most)
    steps = [max(1, min(every, len(one.body.frames) // LEAST_FRAMES)) for one in posed]
    rows = np.sort(np.concatenate([one.body.frames[::step] for one, step in zip(posed, steps, strict=True)]))
    thinned = []
    for one, step in zip(posed, steps, strict=True):
        body = one.body
        frames, attitude = np.searchsorted(rows, body.frames[::step]), body.attitude[::step]
        thinned.append(
            replace(one, body=replace(body, frames=frames, attitude=attitude), translation=one.translation[::step])
        )
    return tuple(thinned), sightings.frames(rows), rows


def _with_faint_directions(found: Pivot, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The covariances of x (p, p) and of each body's offset (k, 3, 3), without what only attitude noise made visible.

    A point on the axis of a pure spin does not move, but with noisy attitudes it seems to: by Σ (tr C − C), C a frame's
    covariance of attitude. Where a direction is seen hardly better than that, it is not seen.
    """
    variance, solution = found.variance, found.solution
    reach = float(np.linalg.norm(origin, axis=1).max())
    # All bodies at once: what one seems to see of the path the others would take for known.
    seeming = block_diag(
        *(
            doubtful(len(body.frames)) * _seeming_information(body, found.sightings, origin, variance)
            for body in found.bodies
        )
    )
    missing, gain = missing_covariance(solution.offset_covariance, solution.offset_path, seeming, variance / reach**2)
    # What is not seen at all may be anywhere within reach.
    spread = reach / np.maximum(found.sampled.lengths(solution.blind), 1e-300)
    covariance = variance * (solution.covariance + gain @ gain.T) + (solution.blind * spread**2) @ solution.blind.T
    offsets = variance * (solution.offset_covariance + missing @ missing.T)
    offsets += (solution.offset_blind * spread**2) @ solution.offset_blind.T
    return covariance, _diagonal_blocks(offsets)


def _diagonal_blocks(matrix: FloatArray) -> FloatArray:
    """Of a matrix (3 k, 3 k), (k, 3, 3)."""
    k = len(matrix) // 3
    return np.asarray(matrix.reshape(k, 3, k, 3)[np.arange(k), :, np.arange(k)])


def _seeming_information(body: Body, sightings: Sightings, origin: FloatArray, variance: float) -> FloatArray:
    """What the noise of a body's attitudes seems to tell of its offset, (3, 3) in S, in the weights' units.

    A frame whose attitude is off by φ sees the offset d moved by φ × d. With C the covariance of φ and Q what the frame
    says of its position when its attitude is not known, that seems to be the information Σ tr([eᵢ]×ᵀ Q [eⱼ]× C).
    """
    every = max(1, len(body.frames) // FEW_FRAMES)
    frames, attitude = body.frames[::every], body.attitude[::every]
    found = pieces(sightings.frames(frames).features(body.features), attitude, origin[frames], body.points)
    inverse = symmetric_inverses(found.turn)
    known = found.shift - np.swapaxes(found.turn_shift, 1, 2) @ inverse @ found.turn_shift
    axes = cross_matrices(np.eye(3))
    return np.asarray(variance * every * np.einsum("iba,kbc,jcd,kda->ij", axes, known, axes, inverse, optimize=True))
