"""The Earth's J2 on an orbit that is given without, where the tracks show it, or do not tell and need to know."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import UntoldOblateness
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.hyperparameters.evidence import conditional, cost, maximise
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.oblateness import oblateness_in, perhaps_oblate, perhaps_oblate_in
from baryscope.estimator.orbits.push import untold_push_beside
from baryscope.estimator.paths.extended_path import based_on
from baryscope.estimator.paths.forces import ForcedPath
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY, ProcessNoisePath
from baryscope.estimator.paths.relative_motion import orbit_in
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.paths.seen_path import as_seen
from baryscope.estimator.paths.trajectory import chosen_path
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.orbits.further_unknowns import FurtherUnknowns
from baryscope.estimator.pivot.pivot_solution import DECISIVE, PivotSolution
from baryscope.estimator.pivot.reduced import fixed_at
from baryscope.estimator.pivot.refinement import refined
from baryscope.estimator.pivot.unexplained import gain_over
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import EARTH_J2, Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NOTICEABLE = 4.0  # squared displacement of the answer by J2, in its covariance: two deviations


def with_oblateness(
    found: PivotSolution, start: InitialSolution, orbit: Orbit | None, options: PathOptions
) -> tuple[PivotSolution, InitialSolution, Orbit | None]:
    """The solution, its start and the orbit, with the Earth's J2 where the tracks show that the orbit told lacks it.

    J2 is a force of a known size. So the tracks tell it from none where they hardly tell process noise, of whose
    densities that of J2 is but one, and which it is not: it acts along the whole path, and goes on beyond. Where they
    do not tell it from none, but the answer depends on it, its share is an unknown.
    """
    path, oblate = found.path, None if orbit is None else orbit.with_earths_j2()
    if (
        oblate is None
        or path.name != "relative-orbit"
        or not isinstance(path, ProcessNoisePath)
        or path.density is not None
    ):
        return found, start, orbit
    assert orbit is not None  # noqa: S101  as it has an oblate one beside it
    wider = chosen_path(options, oblate, path.begin, path.end, start.errors)
    assert isinstance(wider, ProcessNoisePath)  # noqa: S101  as that with the other orbit is
    fresh = _start_on(wider.with_modes(path.count), found, found.solution.x, start)
    shifted = as_seen(fresh.path, fresh.sampled, start.errors, fresh.x)
    test = _ScoreTest.of(found, shifted, fresh.x)
    if test.gain >= DECISIVE:
        other = _refined(fresh, found, options)
        if other is not None and gain_over(found, other, start) >= 0:
            if other.has(DENSITY):  # something else acts, which may be all there is
                test = _ScoreTest.of(found, shifted, fresh.x, untold_push_beside(path, orbit, options))
            if test.gain >= DECISIVE:
                return other, fresh, oblate
    if test.gain <= -DECISIVE or test.displacement < NOTICEABLE:
        return found, start, orbit
    either = perhaps_oblate(orbit, oblate, found.position, (path.begin, path.end), options.acceleration)
    own, others = np.split(found.solution.x, [either.base.size])
    fresh = _start_on(based_on(path, either), found, np.concatenate([own, [0.0], others]), start)
    other = _refined(fresh, found, options)
    return (found, start, orbit) if other is None else (other, fresh, either.orbit)


def _start_on(path: Path, found: PivotSolution, x: FloatArray, start: InitialSolution) -> InitialSolution:
    """The start on another path, at the unknowns near x (p,) that bring it near that of a solution.

    Only those without a prior differ.
    """
    sampled = interpolated(path.at, path.frequency, start.time)
    return start.on(path, sampled, _nearest(found.sampled.itself.position(found.solution.x), x, sampled, path.prior))


def _nearest(position: FloatArray, x: FloatArray, other: SampledPath, prior: Prior) -> FloatArray:
    """The unknowns (p,) of a path that bring it near positions (n, 3); of x those without a prior are moved."""
    apart, free = position - other.position(x), prior.free
    moment = other.moment(slice(0, other.frames), apart[:, :, None])[:, 0] / other.frames
    moved = x.copy()
    moved[free] += symmetric_pseudo_inverse(other.mean_square()[free][:, free]) @ moment[free]
    return moved


def _refined(fresh: InitialSolution, found: PivotSolution, options: PathOptions) -> PivotSolution | None:
    """The solution on another path, from one near it; None if there is none."""
    try:
        other = refined(fresh.near(found), options)
    except ComputationError:
        return None
    return other if other.converged else None


@dataclass(frozen=True)
class _ScoreTest:
    """Whether a path is another one, to first order, with the solution's weights.

    gain: what −2 ln p is less by on the other path; displacement: of the answer, squared in its covariance, where it is
    greatest.
    """

    gain: float
    displacement: float

    @classmethod
    def of(
        cls, found: PivotSolution, sampled: SampledPath, x: FloatArray, push: ForcedPath | None = None
    ) -> "_ScoreTest":
        """The test of a path sampled at the unknowns x (p,), near that of a solution; push: that may act on either.

        The shift from the one to the other, all of it or none, is an unknown. Of many frames some are looked at, each
        with the weight of those it stands for.
        """
        shift = sampled.position(x) - found.sampled.position(found.solution.x)
        told = float((found.observations.weight * found.observations.squares(shift[:, None])).sum()) / found.variance
        if told < NOTICEABLE:  # more than this they do not know of the difference
            return cls(0.0, 0.0)
        prior = found.path.prior
        if push is not None:
            prior = prior.joined(push.own_prior)

        def columns(rows: IntArray) -> FloatArray:
            pushed = [] if push is None else [push.columns(found.time[rows])]
            return np.concatenate([*pushed, shift[rows, :, None]], axis=2)

        further = FurtherUnknowns.of(found, columns)
        linear, last = further.linear, np.array([len(further.at) - 1])
        (none, less), (whole, more) = (fixed_at(linear, last, np.array([share])) for share in (0.0, 1.0))
        theta = maximise(none, prior)
        gain = cost(none, prior, theta) + less - cost(whole, prior, maximise(whole, prior)) - more
        covariance = conditional(none, prior, theta)[1]
        change = np.append(-covariance @ linear.information[:-1, -1], 1.0)
        moved = further.path.position(further.at + change) - further.path.position(further.at)
        own = further.path.covariance(np.pad(covariance, (0, 1)))
        squares = np.sum(moved * np.linalg.solve(own, moved[:, :, None])[:, :, 0], axis=1)
        return cls(gain, float(squares.max()))


def untold_oblateness(told: Orbit | None, path: Path) -> tuple[UntoldOblateness, ...]:
    """The finding of an orbit whose J2 is not told, but on the path, or perhaps."""
    if told is None:
        part = oblateness_in(path)
        return () if part is None else (UntoldOblateness(EARTH_J2, certain=part.told),)
    if oblateness_in(path) is not None:
        return (UntoldOblateness(EARTH_J2, certain=False),)
    orbit, either = orbit_in(path), perhaps_oblate_in(path)
    if told.j2 is not None or orbit is None or orbit.j2 is None:
        return ()
    return (UntoldOblateness(orbit.j2, certain=True) if either is None else UntoldOblateness(either.j2, certain=False),)
