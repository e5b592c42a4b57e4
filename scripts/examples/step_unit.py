"""Step the unit yourself: a chaser that approaches along V-bar and then holds its station. Copy and change it.

python scripts/examples/step_unit.py
"""

import tempfile
from pathlib import Path

import numpy as np

from baryscope.fmu import Session, build_fmu
from baryscope.models.scenario import load_scenario

STEP = 0.1  # s
FREQUENCY, DAMPING = 0.02, 1.0  # rad/s and share of critical, of the station keeping
START, STATION = np.array([0.0, -40.0, 0.0]), np.array([0.0, -30.0, 0.0])  # m, LVLH

with tempfile.TemporaryDirectory() as folder:
    unit = build_fmu(load_scenario("envisat"), Path(folder) / "target.fmu")

    with Session(unit, {"chaser.position0": START}) as session:
        for _ in range(10):
            for _ in range(round(60 / STEP)):
                offset = session.chaser_position - STATION
                command = -(FREQUENCY**2) * offset - 2 * DAMPING * FREQUENCY * session.chaser_velocity
                session.step(STEP, acceleration=command)

            nearest = np.linalg.norm(session.features, axis=1).min()
            print(
                f"{session.time:6.1f} s: {np.linalg.norm(session.position):6.2f} m from the centre of mass, "
                f"{nearest:6.2f} m from the nearest feature"
            )
