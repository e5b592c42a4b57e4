"""A scenario: all tables together, the checks across them, the sample times and the parameters of the unit.

Inertia, orbit, features and range are checked by the same expressions as in the unit, see `baryscope.models.checks`.
"""

from collections.abc import Sequence
from math import hypot, pi
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from baryscope.models.checks import checks_of
from baryscope.models.orbit import orbit_parameters
from baryscope.models.scenario.forces import Drag, EddyCurrents, Light
from baryscope.models.scenario.orbit import OrbitField
from baryscope.models.scenario.schema import FileModel
from baryscope.models.scenario.tables import Chaser, Features, Run, Sensor, Target, Tracking
from baryscope.models.target import TumblingTarget, tumbling_target
from baryscope.models.variables import AXES, Force, Forces, Kind, variable_table

MIN_SAMPLES = 3
MAX_POSITIONS = 10_000_000  # samples × features: a wrong unit of sample_time must not fill the memory
MAX_TURNS = 20_000  # of body and orbit in a run: time and memory of simulation and bound grow with them


class Scenario(FileModel):
    """A scenario: the target, its orbit, the chaser, and how the features are tracked.

    Attributes:
        name: its preset name, or the stem of its file.
        description: one line for lists.
        orbit: in SI units, converted from the file's degrees. All other tables keep the units of the file.
        drag, light, eddy_currents: forces that act where they are given; J2 acts where the orbit has it.
    """

    name: str = "scenario"
    description: str = ""
    target: Target
    features: Features
    orbit: OrbitField
    chaser: Chaser
    tracking: Tracking = Tracking()
    sensor: Sensor = Sensor()
    run: Run = Run()
    drag: Drag | None = None
    light: Light | None = None
    eddy_currents: EddyCurrents | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        known = self.features.labels
        for index, interval in enumerate(self.tracking.intervals):
            for label in interval.features:
                if label not in known:
                    raise ValueError(
                        f"tracking.intervals[{index}].features: found {label!r}, "
                        f"expected labels of features.points ({', '.join(known)})"
                    )
        sliding = self.sensor.outliers.sliding
        if sliding > len(known):
            raise ValueError(f"sensor.outliers.sliding: found {sliding}, expected at most the {len(known)} features")
        most = MAX_POSITIONS // len(known)
        if not MIN_SAMPLES <= self.duration / self.run.sample_time + 1 < most:
            raise ValueError(
                f"run.sample_time: found {self.run.sample_time:g} s, "
                f"expected {MIN_SAMPLES} to {most} samples of {len(known)} features in the run's {self.duration:g} s"
            )
        rate = np.deg2rad(hypot(*self.target.angular_rate_deg)) + self.orbit.mean_motion
        turns = self.duration * rate / (2 * pi)
        if turns > MAX_TURNS:
            raise ValueError(
                f"run.duration: found {self.duration:g} s, in which the target makes {turns:.3g} turns, "
                f"expected at most {MAX_TURNS} turns"
            )
        failure = checks_of(len(self.features.points), self.forces).failure(self.flat_parameters())
        if failure is not None:
            raise ValueError(failure)
        return self

    @property
    def forces(self) -> Forces:
        """What acts besides point-mass gravity, the gravity gradient and the inputs."""
        given = {
            Force.J2: self.orbit.j2,
            Force.DRAG: self.drag,
            Force.LIGHT: self.light,
            Force.EDDY_CURRENTS: self.eddy_currents,
        }
        return frozenset(force for force, table in given.items() if table is not None)

    @property
    def system(self) -> TumblingTarget:
        """The equations of this target: for its number of features, with its forces."""
        return tumbling_target(len(self.features.points), self.forces)

    @property
    def duration(self) -> float:
        """Length of the run, s."""
        return self.orbit.period if self.run.duration is None else self.run.duration

    @property
    def sample_times(self) -> NDArray[np.float64]:
        """Times of the samples, s, from 0 to the last one within the duration."""
        count = int(self.duration / self.run.sample_time * (1 + 1e-12)) + 1
        return np.arange(count, dtype=np.float64) * self.run.sample_time

    def parameters(self) -> dict[str, NDArray[np.float64]]:
        """The unit's parameters by name, arrays in the shapes of the table of variables."""
        values: dict[str, Any] = _tensor("target.inertia", self.target.inertia)
        values |= {
            "target.features": [point.position for point in self.features.points],
            "target.normals": [point.normal for point in self.features.points],
            "target.attitude0": self.target.attitude,
            "target.angularRate0": np.deg2rad(self.target.angular_rate_deg),
            **orbit_parameters(self.orbit),
            "chaser.position0": self.chaser.position,
            "chaser.velocity0": self.chaser.velocity,
            "gravityGradient": float(self.target.gravity_gradient),
            "solver.tolerance": self.run.tolerance,
            **self._force_parameters(),
        }
        return {name: np.asarray(value, dtype=float) for name, value in values.items()}

    def flat_parameters(self) -> NDArray[np.float64]:
        """The unit's parameter vector p, in the order of the table of variables."""
        values = self.parameters()
        table = variable_table(len(self.features.points), self.forces)
        return np.concatenate([values[variable.name].ravel() for variable in table if variable.kind == Kind.PARAMETER])

    def _force_parameters(self) -> dict[str, Any]:
        """The parameters that the unit has for its forces only."""
        values: dict[str, Any] = {}
        if self.orbit.j2 is not None:
            values |= {"orbit.j2": self.orbit.j2, "orbit.equatorialRadius": self.orbit.equatorial_radius}
        if self.drag is not None:
            values |= {
                "atmosphere.density": self.drag.density,
                "atmosphere.referenceRadius": self.drag.reference_radius or self.orbit.semi_major_axis,
                "atmosphere.scaleHeight": self.drag.scale_height,
                "atmosphere.rotationRate": self.drag.rotation_rate,
                "target.drag": self.drag.target,
                "chaser.drag": self.drag.chaser,
            }
        if self.light is not None:
            values |= {
                "sun.direction": self.light.sun,
                "sun.pressure": self.light.pressure,
                "sun.shadowRadius": self.light.shadow_radius,
                "target.light": self.light.target,
                "chaser.light": self.light.chaser,
            }
        if self.eddy_currents is not None:
            values |= _tensor("target.magneticTensor", self.eddy_currents.tensor)
            values["magneticField.dipole"] = self.eddy_currents.dipole
        return values


def _tensor(name: str, rows: Sequence[Sequence[float]]) -> dict[str, Any]:
    """The six parameters of a symmetric tensor."""
    return {f"{name}.{axes}": rows["xyz".index(axes[0])]["xyz".index(axes[1])] for axes in AXES}
