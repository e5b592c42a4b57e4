"""What differs from draw to draw: the target's attitude and rate, the chaser's start, the rig's noise."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.scenario import Scenario, load_scenario

PRESET = "envisat"
TILT = 10.0  # deg, of the attitude about each axis
RATE = 0.1  # of its size
TURN = 5.0  # deg, of its direction about each axis
PLACE, SPEED = 1.0, 5e-3  # m and m/s, of the chaser on each axis


def drawn(seed: int, draw: int) -> Scenario:
    """A draw of the preset, from seed and number alone: normal deviates of the sizes above, any phase of the tumble.

    The attitude is turned by any angle about the orbit's normal and tilted by TILT, the rate by TURN in body axes; its
    size, the chaser's place and velocity in LVLH vary about the preset's, and the rig's noise has a seed of its own.
    """
    rng = np.random.default_rng([seed, draw])
    preset = load_scenario(PRESET)
    normal = lvlh_attitude(preset.orbit, np.zeros(1))[0, :, 2]
    turn = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi) * normal)
    tilt = Rotation.from_rotvec(np.deg2rad(TILT) * rng.standard_normal(3))
    attitude = tilt * turn * Rotation.from_quat(preset.target.attitude, scalar_first=True)
    slant = Rotation.from_rotvec(np.deg2rad(TURN) * rng.standard_normal(3))
    rate = (1 + RATE * rng.standard_normal()) * slant.apply(preset.target.angular_rate_deg)
    place = np.array(preset.chaser.position) + PLACE * rng.standard_normal(3)
    velocity = SPEED * rng.standard_normal(3)
    target = {"attitude": _tuple(attitude.as_quat(scalar_first=True)), "angular_rate_deg": _tuple(rate)}
    chaser = {"position": _tuple(place), "velocity": _tuple(velocity)}
    return preset.model_copy(
        update={
            "target": preset.target.model_copy(update=target),
            "chaser": preset.chaser.model_copy(update=chaser),
            "run": preset.run.model_copy(update={"seed": int(rng.integers(2**32))}),
        }
    )


def _tuple(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, ...]:
    return tuple(values.tolist())
