"""What an estimate finds against its models, as values; `prose` has the sentences."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from baryscope.estimator.paths.burns import FoundBurn

FREE_TUMBLE = "free tumble"  # the model of an ExcessResiduals that is not a path

PushAxes = Literal["lvlh", "inertial", "sun"]


@dataclass(frozen=True)
class LackOfFit:
    """The path departs from its model by about `magnitude` m rms.

    A polynomial in time, a cubic or, by `score`, of degree 4, decreases the normalised sum of squares by chi_square;
    dof is expected for a right model.
    """

    path: str
    magnitude: float
    chi_square: float
    dof: int


@dataclass(frozen=True)
class ExcessResiduals:
    """The residuals with a model (a path's name, or "free tumble") are `ratio` times those without it."""

    model: str
    ratio: float


@dataclass(frozen=True)
class DifferentPoints:
    """Labels of features that are different points in two clusters, by index, and are not used as tie points."""

    labels: tuple[str, ...]
    clusters: tuple[int, int]


@dataclass(frozen=True)
class DisagreeingClusters:
    """Two clusters, by index, see features of the same labels `ratio` times as far apart as their covariances tell.

    The path does not hold between them, or attitudes are spoilt. They are not tied.
    """

    labels: tuple[str, ...]
    clusters: tuple[int, int]
    ratio: float


@dataclass(frozen=True)
class Departure:
    """The path departs from its model by `magnitude` m rms, which white acceleration of a density in m²/s³ explains.

    The result allows for that noise, not for other causes: a camera's attitude that drifts moves the path alike, and
    costs more. significance: 2 ln of the likelihood over that without the noise.
    """

    path: str
    magnitude: float
    density: float
    significance: float


@dataclass(frozen=True)
class WrongOrbit:
    """The target is not where its orbit says: shift (3,) and its deviation (3,), m in LVLH at the middle of the time.

    The estimate is that with the orbit corrected. oblate: whether the orbit has J2, which else may look like this.
    """

    shift: tuple[float, float, float]
    deviation: tuple[float, float, float]
    oblate: bool


@dataclass(frozen=True)
class EstimatedOrbit:
    """No orbit is given, and the path tells one, on which it lies: period in s and eccentricity, with deviations."""

    period: float
    period_deviation: float
    eccentricity: float
    eccentricity_deviation: float


@dataclass(frozen=True)
class UntoldOblateness:
    """The orbit told has no J2, but the tracks are likelier with the Earth's, `j2`, which the estimate has.

    certain: whether they are; if not, they do not tell it from none, and the estimate allows for either.
    """

    j2: float
    certain: bool


@dataclass(frozen=True)
class FramesLeftOut:
    """All observations of successive frames from begin to end, in s, are rejected: the estimate does not hold there.

    frames: their number; magnitude: median shift of the features of a frame from where the estimate has them, m.
    """

    begin: float
    end: float
    frames: int
    magnitude: float


@dataclass(frozen=True)
class FewFrames:
    """Frames with an attitude, too few for so many unknowns: an outlier or a misfit would not be seen.

    lasting: how many of them have the same errors of the features, and count as one.
    """

    frames: int
    unknowns: float
    lasting: float = 1.0


@dataclass(frozen=True)
class FollowsRotation:
    """The path may follow the rotation, with an offset of the centre of mass that is wrong by as much.

    share: of the information on the offset, that noise of the attitudes feigns; unknowns: of the path that the tracks
    determine.
    """

    share: float
    unknowns: float


@dataclass(frozen=True)
class Extrapolated:
    """Attitudes are seen from begin to end, in s, only: before or after, the path is extrapolated far.

    Nothing checks its law there, so that the deviation of what this adds is doubled.
    """

    begin: float
    end: float


@dataclass(frozen=True)
class ContradictedPath:
    """Attitudes are seen from begin to end, in s, only: features seen before or after do not stay at their distances
    from the path.
    """

    begin: float
    end: float


@dataclass(frozen=True)
class OtherBody:
    """Features of these labels are rigid among themselves, but move against those of the estimate; they are left out.

    The chaser's own arm, another object, or a panel that turns: which of the bodies is meant, the tracks do not tell.
    """

    labels: tuple[str, ...]


@dataclass(frozen=True)
class UnknownBurn:
    """A burn that nothing told, in s, changes the chaser's velocity, m/s; with deviations.

    axes: of the change, lvlh, or those of C, inertial, without an orbit.
    """

    begin: float
    begin_deviation: float
    end: float
    end_deviation: float
    change: tuple[float, float, float]
    change_deviation: tuple[float, float, float]
    axes: Literal["lvlh", "inertial"] = "lvlh"

    @classmethod
    def of(cls, burn: FoundBurn, axes: Literal["lvlh", "inertial"]) -> Self:
        """The finding of a burn."""
        change, deviation = tuple(burn.change.tolist()), tuple(np.sqrt(np.diag(burn.covariance)).tolist())
        return cls(burn.begin, burn.begin_deviation, burn.end, burn.end_deviation, change, deviation, axes)


@dataclass(frozen=True)
class UnknownPush:
    """A push that nothing told: the `acceleration` of the target less that of the chaser, m/s², with deviations.

    It is the mean over the tracks of what is constant but for waves of the orbit's frequency in `axes`, of which it has
    the components; sun: away from the Sun, one component, none in the Earth's shadow.
    """

    axes: PushAxes
    acceleration: tuple[float, ...]
    acceleration_deviation: tuple[float, ...]


@dataclass(frozen=True)
class UntoldAccuracy:
    """How exact the orbit is, nobody tells, and the tracks do not decide, but the answer rests on it.

    The estimate allows for an orbit that is off by `place`, m, and for a constant `push`, m/s²: standard deviations, 0
    where it is decided.
    """

    place: float
    push: float


@dataclass(frozen=True)
class WrongSigma:
    """The deviation of a coordinate is `given` a priori, but `found` by the residuals; covariances take the greater.

    Both in m, or as factors on the standard deviations of the tracks' covariances. No model is to blame.
    """

    given: float
    found: float


@dataclass(frozen=True)
class ChangingNoise:
    """The noise changes: from each of the times `begins` in s on it has one of the `deviations` of a coordinate, m.

    Every frame is weighed by its own.
    """

    begins: tuple[float, ...]
    deviations: tuple[float, ...]


@dataclass(frozen=True)
class DepthNoise:
    """Noise has another deviation of a coordinate `along` the line of sight than `across` it, m; at the mean range.

    Every observation is weighed by that. told: `along` over `across` by the tracks' covariances; None without any.
    """

    across: float
    along: float
    told: float | None = None


@dataclass(frozen=True)
class MovingFeatures:
    """Features of some `labels` move on the body, as on a panel that bends: the estimate is made without them."""

    labels: tuple[str, ...]


@dataclass(frozen=True)
class HeldFrames:
    """So many `frames` between two times, s, repeat the one before in every digit: they are not measured, nor used."""

    begin: float
    end: float
    frames: int


@dataclass(frozen=True)
class FreeAttitudes:
    """`ml` or `ekf` has no tumble to tell, for a reason: the estimate is that of `pivot`, whose attitudes are free."""

    reason: str


Finding = (
    LackOfFit
    | ExcessResiduals
    | FramesLeftOut
    | FewFrames
    | FollowsRotation
    | Extrapolated
    | ContradictedPath
    | DifferentPoints
    | DisagreeingClusters
    | OtherBody
    | Departure
    | WrongOrbit
    | EstimatedOrbit
    | UntoldOblateness
    | UntoldAccuracy
    | UnknownBurn
    | UnknownPush
    | WrongSigma
    | ChangingNoise
    | DepthNoise
    | MovingFeatures
    | HeldFrames
    | FreeAttitudes
)
UNCHECKED = FewFrames | ContradictedPath | OtherBody
MISFITS = LackOfFit | ExcessResiduals | FramesLeftOut | DisagreeingClusters
