"""White acceleration noise on a path, as a series of modes with a Gaussian prior.

White noise of density q over T seconds is Σ ξⱼ φⱼ(t)/√T for any orthonormal basis φⱼ, with independent coefficients of
variance q. Here φⱼ are the bending modes of a beam clamped at both ends. Their double integrals are the modes of a free
beam, which are orthogonal to each other and to every constant and linear motion. So they are the Karhunen–Loève basis
of what the noise adds to free flight (Rayleigh, Theory of Sound, ch. VIII): few modes represent it.
On an orbit the gravity gradient adds its response.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import Density
from baryscope.estimator.paths.extended_path import ExtendedPath, parts_of
from baryscope.estimator.paths.linear_motion import ARC, Integrations, Motion, forced, highest_frequency
from baryscope.estimator.paths.path import FIXED, Path
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.sampled_path import SampledPath, of_three_axes

FloatArray = NDArray[np.float64]

DENSITY = "process noise"
FEWEST_MODES, MOST_MODES = 12, 96  # of each axis: at first, and as many as they are doubled to where they are told
UNTOLD = 0.01  # prior variance of a mode times the information on it, from which the tracks tell nothing of it
# m/s^1.5, mean of the root of the density in an orbit: 1e-3, or 2 cm/s in ten minutes, once in 150 cases
TYPICAL = 2e-4
MIDDLE = np.array([0.25, 0.75])  # of the time, between which a lasting acceleration is looked for
SHORTEST = 1e-6  # s, of the time over which noise acts


@dataclass(frozen=True, eq=False)
class ProcessNoisePath(ExtendedPath):
    """A path with white acceleration noise: the unknowns of `base` and, in m, three of each of `count` modes.

    begin … end in s: the time over which the noise acts. A mode's coefficient is the rms displacement it causes.
    density: of the noise in m²/s³; None if it is unknown; least: what it is at least, such as that of an accelerometer;
    most: as many modes as there may be.
    """

    begin: float
    end: float
    count: int = FEWEST_MODES
    density: float | None = None
    least: float = 0.0
    most: int = MOST_MODES

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.base.size + 3 * self.count

    @cached_property
    def prior(self) -> Prior:
        """The prior of the base, and that of the modes: q T³/β⁴ with q, in m²/s³, a hyperparameter."""
        span = self.end - self.begin
        offset = np.repeat(np.log(span**3 / wave_numbers(self.count) ** 4), 3)
        lower = float(np.log(self.least)) if self.least > 0 else None
        # Where the forces are known, noise stands for what is left of them.
        typical = None if self.base.gravity_gradient(np.array([self.begin])) is None else TYPICAL
        unknown = Hyperparameter(DENSITY, lower, optional=lower is None, typical=typical)
        own = Prior(offset, np.ones((len(offset), 1)), (unknown,))
        return self.base.prior.joined(own if self.density is None else own.fixed(DENSITY, float(np.log(self.density))))

    def with_modes(self, count: int) -> "ProcessNoisePath":
        """The path with another number of modes."""
        return replace(self, count=count)

    def omitted_variance(self, density: float) -> float:
        """The mean variance of a coordinate, m², due to the modes beyond `count`, for a density in m²/s³."""
        return density * (self.end - self.begin) ** 3 / (3 * np.pi**4 * (self.count + 1) ** 3)

    def told_modes(self, density: float, information: FloatArray, most: int) -> int:
        """Of how many modes observations can tell anything, at most so many.

        density: in m²/s³; information (p,): of the observations on each of the unknowns, that on higher modes being
        like that on the highest. Where the path is, the offset of the features may leave untold, and how it bends be
        told far better: the variance of its positions would say nothing of the modes that are seen.
        """
        typical = max(float(information[-3:].mean()), 0.0)  # rounding may leave less than none
        beta = (density * (self.end - self.begin) ** 3 * typical / UNTOLD) ** 0.25  # its prior variance is q T³/β⁴
        return int(min(np.ceil(beta / np.pi), most))

    def lasting_variance(self, x: FloatArray, density: float) -> float:
        """The variance of a coordinate of an acceleration that lasts, see `lasting_variance`, for unknowns x (p,)."""
        modes = x[self.base.size : self.size].reshape(self.count, 3)
        span = self.end - self.begin
        change = np.diff(free_modes(MIDDLE, self.count)[1], axis=0)[0] @ modes / span
        return lasting_variance(change, density, float(np.ptp(MIDDLE)) * span)

    @property
    def frequency(self) -> float:
        """The frequency of the base or of the highest mode; see `Path`."""
        return max(self.base.frequency, float(wave_numbers(self.count)[-1]) / (self.end - self.begin))

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        own, response = free_modes(self._scaled(time), self.count)[0], self._response(time)
        base = self.base.at(time)
        return base.with_terms(own) if response is None else base.extended(of_three_axes(own) + response.position(time))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        own = free_modes(self._scaled(time), self.count)[1] / (self.end - self.begin)
        base, response = self.base.rate_at(time), self._response(time)
        return base.with_terms(own) if response is None else base.extended(of_three_axes(own) + response.velocity(time))

    def _scaled(self, time: FloatArray) -> FloatArray:
        return np.asarray((time - self.begin) / (self.end - self.begin))

    def _response(self, time: FloatArray) -> Motion | None:
        """What the gravity gradient G adds to the modes w: δ with δ̈ = G (δ + w), at rest at zero in the middle.

        None in free flight. Computed once for all times within begin … end.
        """
        return self._integrations.over(time)

    @cached_property
    def _integrations(self) -> Integrations[Motion | None]:
        return Integrations(self._integrated, self.begin, self.end)

    def _integrated(self, time: FloatArray) -> Motion | None:
        """The integrated motion of the modes at times (n,) in s besides begin and end, which may lie beyond."""
        times = np.append(time, [self.begin, self.end])
        frequency = highest_frequency(self.base.gravity_gradient, float(times.min()), float(times.max()))
        if frequency == 0:
            return None
        longest = min(ARC / frequency, (self.end - self.begin) / float(wave_numbers(self.count)[-1]))

        def pull(at: FloatArray) -> FloatArray:
            found = self.base.gravity_gradient(at)
            assert found is not None  # noqa: S101  as at the times above
            return found @ of_three_axes(free_modes(self._scaled(at), self.count)[0])

        return forced(times, (self.begin + self.end) / 2, self.base.gravity_gradient, pull, longest)


def lasting_variance(change: FloatArray, density: float, duration: float) -> float:
    """The variance of a coordinate of an acceleration that lasts, (m/s²)², where noise shows one; 0 where it does not.

    change (3,): of the velocity, m/s, by process noise over a duration in s, amid the tracks. White noise of a density
    makes the mean acceleration as large as √(q/duration); what is beyond may go on.
    """
    return max(float(change @ change) / 3 / duration**2 - density / duration, 0.0)


def disturbed(path: Path, noise: Density, begin: float, end: float, known: float = 0.0) -> Path:
    """The path with process noise over begin … end in s: of a density in m²/s³, of an unknown one (auto), or none.

    A fixed point has none: what moves it, it slips by (`PathOptions`). known: the density of a noise that comes to it,
    m²/s³.
    """
    end = max(end, begin + SHORTEST)
    if noise == "auto" and path.name != FIXED:
        return ProcessNoisePath(path, begin, end, least=known)
    density = known + (0.0 if isinstance(noise, str) or path.name == FIXED else noise)
    return ProcessNoisePath(path, begin, end, density=density) if density > 0 else path


def told_slip(path: Path, noise: Density) -> float:
    """The variance of white noise of a fixed point's position that is given, m²; else 0."""
    return 0.0 if isinstance(noise, str) or path.name != FIXED else noise


def noise_in(path: Path) -> ProcessNoisePath | None:
    """The part of a path that has process noise, if one has."""
    return next((one for one in parts_of(path) if isinstance(one, ProcessNoisePath)), None)


def without_noise(path: Path) -> Path:
    """The path without its process noise; itself if it has none."""
    return path.base if isinstance(path, ProcessNoisePath) else path


def with_noise_of(path: Path, base: Path) -> Path:
    """Another base with the process noise of a path; itself if that has none."""
    return replace(path, base=base) if isinstance(path, ProcessNoisePath) else base


def enriched(path: Path, theta: FloatArray, information: FloatArray) -> ProcessNoisePath | None:
    """The path with its modes of process noise doubled until all that are told are there; None if they are.

    theta: hyperparameters, of which the density is the last unless it is given; information (p,): of the observations
    on each of the unknowns.
    """
    if not isinstance(path, ProcessNoisePath):
        return None
    density = path.density if path.density is not None else float(np.exp(theta[-1]))
    needed = path.told_modes(density, information, path.most)
    if path.count >= needed:
        return None
    return path.with_modes(path.count * 2 ** int(np.ceil(np.log2(needed / path.count))))


def with_fewest_modes(path: Path) -> Path:
    """The path with as few modes of process noise as any has; the path itself if it has no more, or no such noise."""
    if not isinstance(path, ProcessNoisePath) or path.count <= FEWEST_MODES:
        return path
    return path.with_modes(FEWEST_MODES)


def wave_numbers(count: int) -> FloatArray:
    """The first roots β (count,) of cos β cosh β = 1, β > 0."""
    odd = (np.arange(1, count + 1) + 0.5) * np.pi
    beta = odd
    for _ in range(4):  # of Newton for cos β = 1/cosh β; only the first few differ from the start
        sech = 2 * np.exp(-beta) / (1 + np.exp(-2 * beta))  # cosh overflows for many modes
        beta = beta + (np.cos(beta) - sech) / (np.sin(beta) - np.tanh(beta) * sech)
    return np.asarray(beta)


def free_modes(u: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Modes of a free beam (n, count) at u (n,) and their derivatives, of mean square 1 over 0 … 1.

    Outside 0 … 1 they go on in a straight line, as free flight does.
    """
    beta = wave_numbers(count)
    s, c, e = np.sin(beta), np.cos(beta), np.exp(-beta)
    denominator = 1 - e * e - 2 * e * s  # 2 e^−β (sinh β − sin β)
    sigma = (1 + e * e - 2 * e * c) / denominator
    left, right = (1 + sigma) / 2, (c - s - e) / denominator
    inside = np.clip(u, 0.0, 1.0)[:, None]
    falling, rising = left * np.exp(-beta * inside), right * np.exp(-beta * (1 - inside))
    sine, cosine = np.sin(beta * inside), np.cos(beta * inside)
    slope = beta * (rising - falling - sine - sigma * cosine)
    return falling + rising + cosine - sigma * sine + (u[:, None] - inside) * slope, slope
