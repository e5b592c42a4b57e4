"""A method of the batch on board: run again and again on all samples so far, in a loop whose other parts stay.

The published method is given more than the paper asks for. The chaser's commands are known: what they do to the path
is taken off the tracks, so that its polynomial has to follow free motion alone, and put back. Between two runs the path
goes on by the relative orbit and the commands from where it ends. Attitude, rate and inertia, which the method does not
estimate, are those of the online estimator.
"""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, estimate
from baryscope.estimator.options import Options
from baryscope.estimator.paths.linear_motion import LinearMotion, Panels
from baryscope.estimator.result import Cluster
from baryscope.fmu.system.master import Unit
from baryscope.models.ephemeris.trajectory import gravity_gradient, target_states
from baryscope.models.errors import ComputationError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.study.loop import RigReader

FloatArray = NDArray[np.float64]

FIRST = 100.0  # s: a turn of the target, as its screws need
PERIOD = 10.0  # s, from run to run


@dataclass(frozen=True, eq=False)
class _Point:
    """A communication point: what commands have done to the target's path since the start, (6,), and the command, LVLH.

    The command acts from here on.
    """

    displaced: FloatArray
    command: FloatArray


class OnBoard:
    """Sets the controller's inputs to what a method tells; a `Pilot` of `fly_loop`.

    method, options: of the batch.

    Attributes:
        told: the CoM's position (3,) in C at each communication point, m; NaN before the first answer.
        runs, refused: how often the method ran, and how often it had no answer.
        cluster: the features of the last answer with the mean of its CoM in their axes; None before.
    """

    def __init__(self, orbit: Orbit, method: str, options: Options | None = None) -> None:
        self._orbit, self._method, self._options = orbit, method, options
        self._times = [0.0]
        self._points = [_Point(np.zeros(6), np.zeros(3))]
        self._sampled: list[float] = []
        self._samples: list[FloatArray] = []
        self._state: FloatArray | None = None
        self._due = FIRST
        self._rig: RigReader | None = None
        self.told: list[FloatArray] = []
        self.runs = self.refused = 0
        self.cluster: Cluster | None = None

    def __call__(self, units: Mapping[str, Unit], time: float) -> None:
        """Go on to a communication point."""
        self._go_on(time, units["target"].vector("chaser.acceleration"))
        self._rig = self._rig or RigReader(units["rig"])
        sample = self._rig.newest()
        if sample is not None:
            moment, points, _ = sample
            self._sampled.append(moment)
            self._samples.append(points - self._displaced(moment)[:3])
        if time >= self._due:
            self._due += PERIOD
            self._run()
        self.told.append(np.full(3, np.nan) if self._state is None else self._state[:3])
        self._tell(units)

    def _go_on(self, time: float, command: FloatArray) -> None:
        """State and displacement at a later time; the command acts from there."""
        last = self._points[-1]
        states = np.column_stack([last.displaced, np.zeros(6) if self._state is None else self._state])
        moved = self._moved(states, self._times[-1], time, last.command)
        self._times.append(time)
        self._points.append(_Point(moved[:, 0], command))
        if self._state is not None:
            self._state = moved[:, 1]

    def _moved(self, states: FloatArray, begin: float, end: float, command: FloatArray) -> FloatArray:
        """Positions and velocities (6, c) of the target in C, at the end, with the chaser's command held in LVLH."""
        equation = LinearMotion.over(
            Panels.over(np.array([end]), begin, end - begin),
            lambda time: gravity_gradient(self._orbit, target_states(self._orbit, time)),
        )
        push = -lvlh_attitude(self._orbit, equation.panels.points) @ command
        forced, at = equation.forced(push[:, :, None]), np.array([end])
        added = np.concatenate([forced.position(at)[0], forced.velocity(at)[0]])
        return np.asarray(equation.transition(at)[0] @ states + added)

    def _displaced(self, time: float) -> FloatArray:
        """What commands have done to the target's path until a time that is gone, (6,)."""
        index = bisect_right(self._times, time) - 1
        begin, point = self._times[index], self._points[index]
        if begin == time:
            return point.displaced
        return self._moved(point.displaced[:, None], begin, time, point.command)[:, 0]

    def _run(self) -> None:
        """The method on all samples, and from its last one to now."""
        self.runs += 1
        labels = tuple(str(k + 1) for k in range(len(self._samples[0])))
        tracks = FeatureTracks(np.array(self._sampled), np.array(self._samples), labels)
        try:
            found = estimate(tracks, method=self._method, orbit=self._orbit, options=self._options)
        except ComputationError:
            self.refused += 1
            return
        if found.velocity is None:
            raise ValueError(f"{self._method}: found no velocity, expected one")
        self.cluster = max(found.clusters, key=lambda cluster: len(cluster.frames))
        begin = self._sampled[-1]
        state = np.concatenate([found.position[-1], found.velocity[-1]]) + self._displaced(begin)
        for index in range(bisect_right(self._times, begin) - 1, len(self._times) - 1):
            start = max(begin, self._times[index])
            state = self._moved(state[:, None], start, self._times[index + 1], self._points[index].command)[:, 0]
        self._state = state

    def _tell(self, units: Mapping[str, Unit]) -> None:
        """The controller's inputs: position, velocity, and where the grapple point is from the CoM in body axes."""
        estimator, controller = units["estimator"], units["controller"]
        if self._state is None:
            controller.set(["navigation.valid"], np.zeros(1))
            return
        R = Rotation.from_quat(_quaternion(estimator.vector("target.attitude")), scalar_first=True)
        grapple = controller.vector("grapple.point")
        if grapple.any():  # the online estimator's, from its CoM
            grapple = grapple + R.inv().apply(estimator.vector("target.position") - self._state[:3])
        for name, values in {
            "target.position": self._state[:3],
            "target.velocity": self._state[3:],
            "grapple.point": grapple,
        }.items():
            controller.set(controller.scalars(name), values)


def _quaternion(values: FloatArray) -> FloatArray:
    """A quaternion, that of no turn while there is none."""
    return values if values.any() else np.array([1.0, 0.0, 0.0, 0.0])
