"""`OnlineEstimator`: the centre of mass frame by frame, with the C core of this room."""

import ctypes
import struct
import zlib
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.estimator.limits import COARSEST, FARTHEST, FARTHEST_UNDER_J2, FINEST, LATEST
from baryscope.estimator.online import core
from baryscope.estimator.online.answers import (
    FloatArray,
    OnlineFeatures,
    OnlineResiduals,
    OnlineState,
    OnlineStatus,
    OnlineTumble,
)
from baryscope.estimator.online.core import MOST_FEATURES, Options, Result, State, Tumble, build, library
from baryscope.estimator.online.given import (
    covariances_of,
    flags,
    rotation_of,
    rows,
    seconds,
    whole_number,
    whole_numbers,
)
from baryscope.models.arguments import array_of, instance_of, number_within
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

STRONGEST = 1e9  # m/s², absolute value of an acceleration's coordinate
LONGEST_GAP = 86400.0  # s, a day
CAMERA = (ctypes.c_double * 9)(1, 0, 0, 0, 1, 0, 0, 0, 1)  # the axes of thrusters that are fixed in C
NO_THRUST = core.Thrust((ctypes.c_double * 3)(), CAMERA)
MAGIC = b"baryscope online\n"
HEAD = struct.Struct("<17s32sI")  # what stands before the memory of a saved filter: MAGIC, its build, its checksum
REFUSED = {
    Result.BAD_TIME: "time: found {time!r} s, expected a time after that of the last frame",
    Result.BAD_COVARIANCE: f"covariance: found one that is not symmetric positive definite, or beyond {COARSEST:g} m",
    Result.BAD_NAME: "names: found the same twice, expected each feature once",
    Result.TOO_LATE: "time: found {time!r} s, expected one at most {gap:g} s, longest_gap, after that of the last one; "
    "after so long a gap begin with a new filter",
    Result.TOO_FAR: f"time: found {{time!r}} s, expected one within {FARTHEST_UNDER_J2:g} s of the last frame, the "
    "first one of time 0 of the orbit: farther J2 is not followed",
}


@dataclass(frozen=True, eq=False)
class Thrust:
    """What the chaser's thrusters are told to do.

    acceleration: (3,) of the chaser in C, m/s²; attitude: (3, 3), R_C_D, of the axes D in which the thrusters are
    fixed and turn with the chaser, so that their misalignment is constant there; None: those of C.

    Raises:
        InputError: a shape or a value is not as above.
    """

    acceleration: ArrayLike
    attitude: ArrayLike | None = None

    def __post_init__(self) -> None:
        push = array_of("acceleration", self.acceleration, (3,)).copy()
        if not (np.abs(push) <= STRONGEST).all():
            raise InputError(f"acceleration: found {push.tolist()}, expected three numbers within {STRONGEST:g} m/s²")
        object.__setattr__(self, "acceleration", push)
        if self.attitude is not None:
            object.__setattr__(self, "attitude", rotation_of("attitude of the thrust", self.attitude))


class OnlineEstimator:
    """A Kalman filter of the centre of mass, in C, with fixed memory; see online.h and docs/online.md.

    Args:
        sigma: standard deviation of a coordinate of a feature, m, where it has no covariance of its own.
        orbit: the target's, by its elements at time 0 and its J2; an ephemeris does not count. None: the centre of mass
            moves in a straight line, but for white acceleration, or an acceleration that wanders, which is estimated.
            With the orbit of a target that has one it is better known.
        offset_radii: standard deviation of the centre of mass from the features' centroid before the first frame, per
            axis, in units of these features' rms distance from it.
        speed_std: of its velocity before the first frame, per axis, m/s.
        attitude_noise: of the camera's attitude, per axis and frame, rad.
        thrust_std: of what the chaser's thrusters are wrong by, of their scale, and of their direction, rad about each
            axis. It is estimated; 0: told accelerations are exact.
        longest_gap: from one frame to the next, s. A later frame is refused: after one whose time stamp is wrong all
            others would be too early. After a gap that was so long begin with a new filter.

    Raises:
        InputError: a value is out of range.
        ComputationError: there is no C compiler, or it fails.
    """

    def __init__(
        self,
        sigma: float,
        orbit: Orbit | None = None,
        *,
        offset_radii: float = core.OFFSET,
        speed_std: float = core.SPEED,
        attitude_noise: float = 0.0,
        thrust_std: float = core.THRUST,
        longest_gap: float = LONGEST_GAP,
    ) -> None:
        if orbit is not None:
            instance_of("orbit", orbit, Orbit, "as of load_orbit")
        settings = Options(
            _within("sigma", sigma, FINEST, COARSEST, "m"),
            _within("offset_radii", offset_radii, 0.1, 1e3, "radii"),
            _within("speed_std", speed_std, FINEST, COARSEST, "m/s"),
            _within("attitude_noise", attitude_noise, 0.0, 1.0, "rad"),
            _within("thrust_std", thrust_std, 0.0, 1.0, "of the acceleration"),
            _within("longest_gap", longest_gap, FINEST, LATEST, "s"),
            float(orbit is not None),
            core.Orbit() if orbit is None else core.Orbit.of(orbit),
        )
        self._library = library()
        self._memory = ctypes.create_string_buffer(self._library.online_size())
        self._library.online_start(self._memory, ctypes.byref(settings))

    def update(
        self,
        time: float,
        points: ArrayLike,
        seen: ArrayLike | None = None,
        *,
        names: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        acceleration: ArrayLike | Thrust | None = None,
    ) -> OnlineState:
        """Take a frame.

        Args:
            time: in s, after that of the last frame, by `longest_gap` at most.
            points: (m, 3), where features are in C, m; [] if nothing is seen. At most 32 of them are seen.
            seen: (m,), which of them are seen; None: those that are not NaN.
            names: (m,), whole numbers that tell the features from each other; None: 0 to m − 1. A feature that
                returns under another name is recognised by its place.
            covariance: (m, 3, 3), of the points, m²; None: that of sigma.
            acceleration: (3,), of the chaser in C since the last frame, m/s², or with the attitude of its thrusters,
                which is that of C otherwise; None: zero.

        Returns:
            The state at the time.

        Raises:
            InputError: a shape or a value is not as above; the filter is then as it was before.
        """
        time = seconds(time)
        if not abs(time) <= LATEST:
            raise InputError(f"time: found {time!r} s, expected one within {LATEST:g} s")
        place = rows("points", points, 3)
        m = len(place)
        there = ~np.isnan(place).any(axis=1) if seen is None else flags(seen)
        labels = np.arange(m) if names is None else whole_numbers(names)
        if there.shape != (m,) or labels.shape != (m,):
            raise InputError(
                f"seen and names: found {there.shape} and {labels.shape}, expected one of each point, ({m},)"
            )
        if there.sum() > MOST_FEATURES:
            raise InputError(f"points: found {there.sum()} in a frame, expected at most {MOST_FEATURES}")
        place, labels = np.ascontiguousarray(place[there]), np.ascontiguousarray(labels[there])
        absurd = ~(np.abs(place) <= FARTHEST).all(axis=1)
        if absurd.any():
            raise InputError(
                f"points: found {place[absurd][0].tolist()}, expected numbers within {FARTHEST:g} m where seen"
            )
        upper = None
        if covariance is not None:
            spread = covariances_of(covariance, there)
            if spread is None:
                raise InputError(REFUSED[Result.BAD_COVARIANCE])
            upper = np.ascontiguousarray(elements_of(spread))
        push = _thrust(acceleration)
        result = self._library.online_update(
            self._memory,
            time,
            len(place),
            labels.ctypes.data_as(ctypes.POINTER(ctypes.c_longlong)),
            _numbers(place),
            None if upper is None else _numbers(upper),
            ctypes.byref(push),
        )
        if result != Result.ACCEPTED:
            gap = Options.from_buffer(self._memory).longest_gap  # a restored filter has its own
            raise InputError(REFUSED[Result(result)].format(time=time, gap=gap))
        return self.predict(time)

    def predict(self, time: float, acceleration: ArrayLike | Thrust | None = None) -> OnlineState:
        """The state at a time in s that is not before the last frame; acceleration: as of `update`, till then.

        Raises:
            InputError: the time is before the last frame or too late, or a value is not finite.
        """
        found, time = State(), seconds(time)
        push, result = ctypes.byref(_thrust(acceleration)), ctypes.byref(found)
        late = _is_too_late(time)
        answer = Result.BAD_TIME if late else self._library.online_predict(self._memory, time, push, result)
        if answer != Result.ACCEPTED:
            raise _not_to_be_predicted(time, Result(answer))
        status = list(OnlineStatus)[int(found.status)]
        r, v, R, P = (np.array(value) for value in (found.r, found.v, found.R, found.covariance))
        thrust, of_thrust = np.array(found.thrust), np.array(found.of_thrust).reshape(4, 4)
        scalars = found.density, found.noise_ratio, found.lasting, int(found.maps)
        return OnlineState(
            time, r, v, P.reshape(6, 6), R.reshape(3, 3), status, *scalars, thrust, of_thrust, found.execution
        )

    def tumble(self, time: float) -> OnlineTumble | None:
        """The tumble at a time in s that is not before the last frame; None as long as no free tumble is known.

        Raises:
            InputError: the time is before the last frame, or too late.
        """
        found, time = Tumble(), seconds(time)
        if _is_too_late(time) or self._library.online_tumble(self._memory, time, ctypes.byref(found)):
            raise _not_to_be_predicted(time)
        if not found.known:
            return None
        shapes = {"R": (3, 3), "turn": (3, 3), "rate": (3,), "of_rate": (3, 3), "inertia": (3, 3), "of_inertia": (5, 5)}
        return OnlineTumble(*(np.array(getattr(found, name)).reshape(shape) for name, shape in shapes.items()))

    def point(
        self, name: int, time: float, acceleration: ArrayLike | Thrust | None = None
    ) -> tuple[FloatArray, FloatArray] | None:
        """Where a feature will be, (3,) in C, m, and the covariance (3, 3); None without a tumble or such a feature.

        Args:
            name: of the feature.
            time: in s, not before the last frame.
            acceleration: as of `update`, till then; None: zero.

        Raises:
            InputError: the time is before the last frame or too late, or a value is not finite.
        """
        name, time = whole_number(name), seconds(time)
        position, covariance, push = np.empty(3), np.empty((3, 3)), _thrust(acceleration)
        if _is_too_late(time):
            raise _not_to_be_predicted(time)
        result = self._library.online_point(
            self._memory, time, ctypes.byref(push), name, _numbers(position), _numbers(covariance)
        )
        if result in (Result.BAD_TIME, Result.TOO_FAR):
            raise _not_to_be_predicted(time, Result(result))
        return (position, covariance) if result == Result.ACCEPTED else None

    def features(self) -> OnlineFeatures:
        """The map of the features."""
        names = np.empty(MOST_FEATURES, dtype=np.int64)
        position, covariance = np.empty((MOST_FEATURES, 3)), np.empty((MOST_FEATURES, 3, 3))
        of_names = names.ctypes.data_as(ctypes.POINTER(ctypes.c_longlong))
        count = self._library.online_features(self._memory, of_names, _numbers(position), _numbers(covariance))
        return OnlineFeatures(names[:count], position[:count], covariance[:count])

    def residuals(self) -> OnlineResiduals:
        """How far the points of the last frame are off the map, and which of them fit; of those that it had."""
        names = np.empty(MOST_FEATURES, dtype=np.int64)
        residual, fits = np.empty((MOST_FEATURES, 3)), np.empty(MOST_FEATURES, dtype=np.intc)
        of_names = names.ctypes.data_as(ctypes.POINTER(ctypes.c_longlong))
        of_fits = fits.ctypes.data_as(ctypes.POINTER(ctypes.c_int))
        count = self._library.online_residuals(self._memory, of_names, _numbers(residual), of_fits)
        return OnlineResiduals(names[:count], residual[:count], fits[:count] > 0)

    def save(self) -> bytes:
        """All that the filter knows, for `restored` by the same version on a machine of the same kind."""
        memory = self._memory.raw
        return HEAD.pack(MAGIC, build(), zlib.crc32(memory)) + memory

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies, and what pickle writes, are by `save`."""
        return type(self).restored, (self.save(),)

    @classmethod
    def restored(cls, content: bytes | bytearray | memoryview) -> Self:
        """The filter that `save` gave, which goes on to the last bit as the saved one.

        Raises:
            InputError: the content is not a saved filter of this version, or is damaged.
        """
        size = HEAD.size + library().online_size()
        if not isinstance(content, bytes | bytearray | memoryview):
            raise InputError(f"a saved filter: found {type(content).__name__}, expected bytes")
        content = bytes(content)
        if not content.startswith(MAGIC) or len(content) != size:
            raise InputError(f"a saved filter: found {len(content)} bytes, expected {size} that begin with {MAGIC!r}")
        _, version, checksum = HEAD.unpack_from(content)
        memory = content[HEAD.size :]
        if version != build():
            raise InputError("a saved filter: found one of another version, expected one of this")
        if checksum != zlib.crc32(memory):
            raise InputError("a saved filter: found damaged bytes, expected those of `save`")
        made = cls(1.0)
        ctypes.memmove(made._memory, memory, len(memory))
        return made


def _within(name: str, value: float, low: float, high: float, unit: str) -> float:
    return number_within(name, value, low, high, f"{low:g} to {high:g} {unit}")


def _is_too_late(time: float) -> bool:
    return not time <= LATEST


def _not_to_be_predicted(time: float, result: Result = Result.BAD_TIME) -> InputError:
    if result is Result.TOO_FAR:
        return InputError(REFUSED[result].format(time=time))
    return InputError(f"time: found {time!r} s, expected one that is not before the last frame, up to {LATEST:g} s")


def _thrust(given: ArrayLike | Thrust | None) -> core.Thrust:
    if given is None:
        return NO_THRUST
    told = given if isinstance(given, Thrust) else Thrust(given)
    axes = CAMERA if told.attitude is None else (ctypes.c_double * 9)(*np.ravel(told.attitude))
    return core.Thrust((ctypes.c_double * 3)(*np.asarray(told.acceleration)), axes)


def _numbers(values: FloatArray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
