"""ApproachController as its tests step it."""

import numpy as np

from baryscope.models.approach.reckoning import MODES
from importer import Stepped

STEP = 0.5  # s
SPEED, RATE, GAIN, LIMIT, STANDOFF = 0.1, 0.02, 0.2, 0.05, 2.0  # the start values
WAITING, NOMINAL, RECKONING, RETREAT = range(len(MODES))
INPUTS = ("target.position", "target.velocity", "target.attitude", "target.angularRate")
WRONG = np.array([0.05, 0.02, -0.01, 0.03])  # of thrusters: a scale, and a rotation vector in the camera's axes


class Controller(Stepped):
    step_size = STEP
