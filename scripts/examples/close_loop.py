"""Close the loop with four units: a chaser flies to a grapple point of tumbling Envisat, on estimates only. To copy.

python scripts/examples/close_loop.py
"""

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from baryscope.fmu import UnitSession, build_fmu
from baryscope.models.scenario import load_scenario

STEP, DURATION, GRAPPLED = 0.5, 900.0, 0  # s, s, the feature to fly to
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
    "controller": {
        **{f"target.{name}": ("estimator", f"target.{name}") for name in ("position", "velocity", "attitude")},
        **{f"target.{name}": ("estimator", f"target.{name}") for name in ("angularRate", "inertia")},
        **{f"target.{name}": ("estimator", f"target.{name}") for name in ("positionCovariance", "velocityCovariance")},
        **{name: ("estimator", name) for name in ("navigation.valid", "sight.position", "thrust.error")},
    },
}
PARAMETERS: dict[str, dict[str, ArrayLike]] = {
    "rig": {"sampling.period": STEP, "camera.attitudeNoise": 1e-4},
    "estimator": {"camera.attitudeNoise": 1e-4},
    "controller": {"synchronised": True},
}

scenario = load_scenario("envisat")
with tempfile.TemporaryDirectory() as folder:
    units = {}
    for name in LINKS:
        fmu = build_fmu(scenario, Path(folder) / f"{name}.fmu", unit=name)
        units[name] = UnitSession(fmu, PARAMETERS.get(name))
    target, estimator, controller = (units[name] for name in ("target", "estimator", "controller"))

    for step in range(round(DURATION / STEP) + 1):
        if step * STEP % 100 == 0:
            centre, feature = target["target.position"], target["features"][GRAPPLED]
            away, error = np.linalg.norm([feature, estimator["target.position"] - centre], axis=1)
            print(
                f"{step * STEP:5.0f} s: {away:6.2f} m from the grapple point; centre of mass known to {error:7.3f} m, "
                f"tumble {'known' if estimator['tumble.known'] else 'not yet'}"
            )
        for name, links in LINKS.items():
            units[name].set_inputs({own: units[other][output] for own, (other, output) in links.items()})
        controller.set_inputs({"grapple.point": estimator["body.features"][GRAPPLED]})  # where its map has it
        for unit in units.values():
            unit.step(STEP)

    for unit in units.values():
        unit.close()
