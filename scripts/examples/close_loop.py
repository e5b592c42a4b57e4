"""Close the loop with four units: the chaser glides to 15 m on V-bar, on estimates only. Copy and change it.

python scripts/examples/close_loop.py
"""

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from baryscope.fmu import UnitSession, build_fmu
from baryscope.models.scenario import load_scenario

STEP = 1.0  # s
LINKS = {  # unit → its input: the unit and the output that it comes from
    "target": {"chaser.acceleration": ("controller", "command.acceleration")},
    "rig": {
        "features": ("target", "features"),
        "normals": ("target", "normals"),
        "camera.attitude": ("controller", "camera.attitude"),
    },
    "estimator": {
        **{name: ("rig", name) for name in ("points", "covariances", "seen", "sample.time", "sample.number")},
        "camera.attitude": ("rig", "camera.measuredAttitude"),
        "chaser.acceleration": ("controller", "command.acceleration"),
    },
    "controller": {name: ("estimator", name) for name in ("target.position", "target.velocity", "navigation.valid")},
}
PARAMETERS: dict[str, dict[str, ArrayLike]] = {
    "rig": {"camera.attitudeNoise": 1e-4},
    "estimator": {"camera.attitudeNoise": 1e-4},
    "controller": {"hold.position": [0.0, -15.0, 0.0], "keepOut.radius": 12.0, "guidance.speed": 0.05},
}

scenario = load_scenario("envisat")
with tempfile.TemporaryDirectory() as folder:
    units = {}
    for name in LINKS:
        fmu = build_fmu(scenario, Path(folder) / f"{name}.fmu", unit=name)
        units[name] = UnitSession(fmu, PARAMETERS.get(name))

    for step in range(901):
        if step % 100 == 0:
            true, found = units["target"]["target.position"], units["estimator"]["target.position"]
            away, error = np.linalg.norm([true, found - true], axis=1)
            valid = "tracking" if units["estimator"]["navigation.valid"] else "not yet"
            print(f"{step * STEP:5.0f} s: {valid}, {away:6.2f} m away, estimated within {1000 * error:5.0f} mm")
        for name, links in LINKS.items():  # all inputs of a step are outputs of the step before
            units[name].set_inputs({own: units[other][output] for own, (other, output) in links.items()})
        for unit in units.values():
            unit.step(STEP)

    for unit in units.values():
        unit.close()
