"""The chaser's known acceleration, as the log of its thrusters or of an accelerometer tells."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.estimator.limits import LATEST
from baryscope.models.arguments import array_of, number_within
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
AccelerationAxes = Literal["inertial", "lvlh", "camera"]

STRONGEST = 1e3  # m/s²
TURN = 0.2  # rad, that axes turn at most in a panel of an integration
ATTITUDES = 2000  # times at which the camera's rate is looked at
MOST_FIRINGS = 32  # with errors of their own
MOST_CHANGES = 100_000  # of the acceleration: the response to more takes minutes and gigabytes


@dataclass(frozen=True, eq=False, init=False)
class KnownAcceleration:
    """What accelerates the chaser besides gravity: time (k,) in s, ascending; value (k, 3) in m/s².

    Each value is held until the next; before the first it is zero, and the last one is held on.

    axes: inertial (those of the tracks), lvlh (of the target's orbit as it is told, whatever its error), or camera;
    attitude: for camera, the function from times (n,) in s to the rotations (n, 3, 3) from the camera's axes to
    inertial ones, as `camera.attitude.at`. scale: standard deviation of the relative error of the scale, the same for
    all values; firing: that of each coordinate's error in a firing, over the acceleration's magnitude, independent from
    firing to firing. noise: density of the white noise of the log, m²/s³.

    Raises:
        InputError: a shape, an order or a value is not as above, or camera axes without an attitude.
    """

    time: FloatArray
    value: FloatArray
    axes: AccelerationAxes
    scale: float
    firing: float
    noise: float
    attitude: Callable[[FloatArray], FloatArray] | None

    def __init__(
        self,
        time: ArrayLike,
        value: ArrayLike,
        axes: AccelerationAxes = "inertial",
        *,
        scale: float = 0.0,
        firing: float = 0.0,
        noise: float = 0.0,
        attitude: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        moments, values = array_of("acceleration: time", time), array_of("acceleration: value", value)
        if moments.ndim != 1 or not len(moments) or values.shape != (len(moments), 3):
            raise InputError(
                f"acceleration: time has the shape {moments.shape} and value {values.shape}, expected (k,) and (k, 3)"
            )
        if not (np.abs(moments) <= LATEST).all() or not (np.diff(moments) > 0).all():
            raise InputError("acceleration: times that do not ascend, expected each later than the one before")
        if not (np.abs(values) <= STRONGEST).all():
            row = int(np.argmax(~(np.abs(values) <= STRONGEST).all(axis=1)))
            raise InputError(
                f"acceleration: {values[row].tolist()} at {moments[row]} s, expected within ±{STRONGEST:g} m/s²"
            )
        if axes not in get_args(AccelerationAxes):
            raise InputError(f"acceleration: axes are {axes!r}, expected inertial, lvlh or camera")
        if axes == "camera" and attitude is None:
            raise InputError("acceleration: axes are camera, which needs the camera's attitude")
        for name, number, limit in (("scale", scale, 1.0), ("firing", firing, 1.0), ("noise", noise, STRONGEST)):
            number_within(f"acceleration: {name}", number, 0.0, limit, f"0 to {limit:g}")
        changed = np.concatenate([[True], (np.diff(values, axis=0) != 0).any(axis=1)])
        if np.count_nonzero(changed) > MOST_CHANGES:
            raise InputError(
                f"acceleration: changes {np.count_nonzero(changed)} times, expected at most {MOST_CHANGES} times; "
                "average it over longer intervals"
            )
        fields = {"time": moments[changed], "value": values[changed], "axes": axes, "attitude": attitude}
        for name, content in (fields | {"scale": float(scale), "firing": float(firing), "noise": float(noise)}).items():
            object.__setattr__(self, name, content)

    def __str__(self) -> str:
        return (
            f"{len(self.time)} values in {self.axes} axes from {self.time[0]:g} to {self.time[-1]:g} s, "
            f"scale ±{self.scale:g}, each firing ±{self.firing:g}, noise {self.noise:g} m²/s³"
        )

    def __deepcopy__(self, memo: object) -> "KnownAcceleration":
        return self  # it does not change

    def smooth_for(self, begin: float, end: float) -> float:
        """The time in s over which the camera's axes turn by at most TURN while it is accelerated within begin … end.

        Where there is no thrust, an attitude may be unknown.
        """
        if self.attitude is None or self.axes != "camera":
            return float("inf")
        first, last = np.maximum(self.time, begin), np.minimum(np.append(self.time[1:], np.inf), end)
        rows = self.value.any(axis=1) & (last > first)
        if not rows.any():
            return float("inf")
        first, length = first[rows], (last - first)[rows]
        passed = np.cumsum(length)
        mark = passed[-1] * (np.arange(ATTITUDES) + 0.5) / ATTITUDES  # of the time under thrust
        row = np.searchsorted(passed, mark)
        step = np.minimum(length, (end - begin) / ATTITUDES)[row]
        start = first[row] + np.clip(mark - (passed - length)[row], 0.0, length[row] - step)
        cosine = (np.einsum("nij,nij->n", self.attitude(start), self.attitude(start + step)) - 1) / 2
        fastest = float((np.arccos(np.clip(cosine, -1, 1)) / step).max())
        return TURN / max(fastest, 1e-12)

    def firings(self, begin: float, end: float) -> NDArray[np.intp]:
        """The firing (k,) to which each value belongs, from 0 on: values without a zero between them; −1 for none.

        Only those that reach into begin … end in s count. Beyond MOST_FIRINGS, neighbours are taken together: their
        errors then count as the same, which is the cautious assumption.
        """
        fires = np.asarray(self.value.any(axis=1))
        number = np.cumsum(fires & ~np.concatenate([[False], fires[:-1]])) - 1
        within = fires & (np.append(self.time[1:], np.inf) > begin) & (self.time < end)
        kept = np.unique(number[within])
        order = np.searchsorted(kept, number) * min(MOST_FIRINGS, len(kept)) // max(len(kept), 1)
        return np.where(fires & np.isin(number, kept), order, -1)

    def fires(self, begin: float, end: float) -> bool:
        """Whether a firing reaches into begin … end, s."""
        return bool((self.firings(begin, end) >= 0).any())

    def besides(self, begin: float, end: float) -> "KnownAcceleration":
        """The same without the firings that reach into begin … end, s."""
        left = np.where(self.firings(begin, end)[:, None] >= 0, 0.0, self.value)
        errors = {"scale": self.scale, "firing": self.firing, "noise": self.noise}
        return KnownAcceleration(self.time, left, self.axes, attitude=self.attitude, **errors)

    def held_at(self, time: FloatArray) -> NDArray[np.intp]:
        """The index (n,) of the value that is held at times (n,) in s, −1 before the first."""
        return np.searchsorted(self.time, time, "right") - 1

    def inertial(self, time: FloatArray, orbit: Orbit | None) -> FloatArray:
        """The acceleration (n, 3) of the chaser in C, m/s², at times (n,) in s.

        Raises:
            InputError: LVLH axes without an orbit.
        """
        row = self.held_at(time)
        held = np.where(row[:, None] >= 0, self.value[np.maximum(row, 0)], 0.0)
        if self.axes == "inertial":
            return held
        pushed = held.any(axis=1)  # where there is no thrust, an attitude may be unknown
        if pushed.any():
            R = self.axes_at(time[pushed], orbit)
            held[pushed] = (R @ held[pushed][:, :, None])[:, :, 0]
        return held

    def axes_at(self, time: FloatArray, orbit: Orbit | None) -> FloatArray:
        """The rotations (n, 3, 3) from the axes of the values to those of C, at times (n,) in s.

        Raises:
            InputError: LVLH axes without an orbit.
        """
        if self.attitude is not None and self.axes == "camera":
            return self.attitude(time)
        if self.axes == "inertial":
            return np.tile(np.eye(3), (len(time), 1, 1))
        if orbit is None:
            raise InputError("acceleration: axes are lvlh, which need the target's orbit; expected an orbit")
        return lvlh_axes(target_states(orbit, time))
