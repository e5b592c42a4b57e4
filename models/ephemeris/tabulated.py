"""Positions and velocities at given times, interpolated between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.models.ephemeris.utc import Moment, seconds_between, utc_text
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]

NODES = 6  # from whose positions and velocities a time between is interpolated: a polynomial of degree 11


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch without jumps: moments (k,), ascending, and states (k, 6) in m and m/s; of use from begin to end."""

    moments: NDArray[np.datetime64]
    states: FloatArray
    begin: Moment
    end: Moment


@dataclass(frozen=True, eq=False)
class Tabulated:
    """Segments of an ephemeris, in the order of time, as seen from time 0 at the moment `begin`.

    axes: their name in the file. source: names the file in errors.
    """

    segments: tuple[Segment, ...]
    begin: Moment
    axes: str
    source: str

    def states(self, time: FloatArray) -> FloatArray:
        """Position and velocity (n, 6), m and m/s, at times (n,) in s; where segments overlap, of the later one.

        Raises:
            InputError: a time outside the segments.
        """
        found = np.full((len(time), 6), np.nan)
        for segment in self.segments:
            first, last = (seconds_between(self.begin, moment) for moment in (segment.begin, segment.end))
            inside = (time >= first - 1e-6) & (time <= last + 1e-6)
            if inside.any():
                found[inside] = _interpolated(segment, self.begin, time[inside])
        missing = np.isnan(found[:, 0])
        if missing.any():
            moment = self.begin + np.timedelta64(round(float(time[int(np.argmax(missing))]) * 1e9), "ns")
            covered = " and ".join(f"{utc_text(one.begin)} to {utc_text(one.end)}" for one in self.segments[:3])
            raise InputError(f"{self.source}: has no position at {utc_text(moment)}, expected within {covered}")
        return found


def _interpolated(segment: Segment, begin: Moment, time: FloatArray) -> FloatArray:
    """The states (n, 6) at times (n,) in s from `begin`."""
    from scipy.interpolate import KroghInterpolator  # slow to load, and few need it

    nodes = (segment.moments - begin).astype("timedelta64[ns]").astype(np.int64) / 1e9
    count = min(NODES, len(nodes))
    after = np.searchsorted(nodes, time, "right")
    first = np.clip(after - count // 2, 0, len(nodes) - count)
    found = np.empty((len(time), 6))
    for window in np.unique(first):
        rows = np.flatnonzero(first == window)
        at, states = nodes[window : window + count], segment.states[window : window + count]
        centre, scale = (at[0] + at[-1]) / 2, max((at[-1] - at[0]) / 2, 1e-9)
        doubled = np.repeat((at - centre) / scale, 2)
        values = np.stack([states[:, :3], states[:, 3:] * scale], axis=1).reshape(2 * count, 3)
        polynomial = KroghInterpolator(doubled, values)
        s = (time[rows] - centre) / scale
        found[rows, :3], found[rows, 3:] = polynomial(s), polynomial.derivative(s) / scale
    return found
