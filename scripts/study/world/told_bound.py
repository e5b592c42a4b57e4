"""What is not known of forces that an estimator is told, as columns of the path with a variance each."""

import numpy as np
from numpy.typing import NDArray

from baryscope.models.orbit import Orbit
from baryscope.study.population.motion import lvlh_axes, relative_motion
from baryscope.study.world.disturbances import Disturbance, response
from baryscope.study.world.forces import through_air, towards_sun
from baryscope.study.world.scenes import LOG_ERROR, SHIFT, TURN, Scene, displaced

FloatArray = NDArray[np.float64]

BROAD = 1e-4  # m/s², standard deviation of an acceleration that may be any
STEP = 1e-2  # of a wrong orbit, in differences


def unknown_of_told(made: Scene) -> Disturbance | None:
    """The size of drag or light, the errors of the log, or those of the orbit; None where all is known."""
    world, orbit, time = made.world, made.orbit, made.time
    if orbit is None:
        return None
    if world.drag or world.light:
        sun = towards_sun(orbit) if world.light else np.zeros(3)
        columns = response(
            orbit, time, lambda t, here: (through_air(here) if world.drag else sun)[None], 1, 10 * world.drag or 1e-6
        )
        return Disturbance(columns, np.array([BROAD**2]), True)
    if world.logged == "to 1 %" and made.burns:
        return Disturbance(_of_log(made, orbit), np.full(3 * len(made.burns), LOG_ERROR**2), True)
    if world.wrong_orbit:
        variance = np.repeat([SHIFT**2 / 3, TURN**2 / 3], 3)  # in any direction
        return Disturbance(_of_orbit(orbit, time), variance, True)
    return None


def _of_log(made: Scene, orbit: Orbit) -> FloatArray:
    """The responses (n, 3, 3 b) to each component of b burns in LVLH."""
    burns = made.burns or ()

    def accelerations(t: float, here: FloatArray) -> FloatArray:
        axes = lvlh_axes(here[None])[0][0]
        burning = [(burn.begin <= t < burn.end) * burn.acceleration for burn in burns]
        return np.concatenate([(axes * own).T for own in burning])

    edges = [edge for burn in burns for edge in (burn.begin, burn.end)]
    return response(orbit, made.time, accelerations, 3 * len(burns), 0.1, edges)


def _of_orbit(orbit: Orbit, time: FloatArray) -> FloatArray:
    """The derivatives (n, 3, 6) of a relative motion by shifts and turns of the orbit in I."""
    start, found = np.array([[0.0, -20.0, 0.0, 0.0, 0.0, 0.0]]), []
    for index in range(6):
        sizes = np.zeros(6)
        sizes[index] = STEP * (SHIFT if index < 3 else TURN)
        ends = [relative_motion(displaced(orbit, *np.split(s, 2)), start, time)[0][0, :, :3] for s in (sizes, -sizes)]
        found.append(-(ends[0] - ends[1]) / (2 * sizes[index]))
    return np.stack(found, axis=2)
