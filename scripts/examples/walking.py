"""A walking trial as motion capture records it, with a known truth: docs/walking.trc. To copy.

python scripts/examples/walking.py FILE.trc

Eight seconds at 50 Hz: four strides on a treadmill, then two circles of the straight leg in the air. Pelvis, right
thigh and right shank have four markers each. The hip is a ball, the knee almost a hinge. Skin slides with all markers
of a segment, in step with the gait and slowly besides, and under each marker by itself; THIGH.4 is on a loose strap.
The cameras add 0.3 mm.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks
from baryscope.estimator.formats import write_trc
from baryscope.models.errors import InputError
from baryscope.models.files import replacing

FloatArray = NDArray[np.float64]

RATE, SECONDS, STRIDE = 50.0, 8.0, 1.1  # Hz, s, s
STOP, CIRCLE = 4.4, 1.8  # s: when the circles begin, and how long one takes
CAMERAS, OWN, SHARED, IN_STEP = 0.0003, 0.001, 0.0015, 0.0025  # m: of cameras, of each marker's skin, of a segment's
LOOSE = {"THIGH.4": 4.0}  # factor on a marker's own skin
OWN_TIME, SHARED_TIME = 0.1, 0.3  # s, for which skin stays to one side
LABELS = (
    ("ASIS.R", "ASIS.L", "PSIS.R", "PSIS.L"),
    tuple(f"THIGH.{k}" for k in "1234"),
    tuple(f"SHANK.{k}" for k in "1234"),
)
# In m and in each segment's axes (x forward, y left, z up) from hip, hip and knee.
PELVIS = np.array([[0.05, -0.04, 0.10], [0.05, 0.21, 0.10], [-0.13, 0.04, 0.11], [-0.13, 0.14, 0.11]])
THIGH = np.array([[0.09, -0.02, -0.15], [0.02, -0.09, -0.20], [0.08, 0.01, -0.30], [0.00, -0.07, -0.34]])
SHANK = np.array([[0.05, -0.02, -0.10], [0.00, -0.06, -0.16], [0.05, 0.00, -0.26], [0.00, -0.05, -0.33]])
KNEE_AXIS = Rotation.from_euler("xz", [4.0, -6.0], degrees=True).apply([0.0, 1.0, 0.0])  # in the thigh
KNEE = np.array([0.0, 0.0, -0.41])  # from the hip, in the thigh


@dataclass(frozen=True)
class Walk:
    """What was recorded, and what is true.

    Attributes:
        time: (n,), s.
        markers: (n, 12, 3), m, in the room: x forward, y left, z up.
        labels: of the markers.
        hip, knee: (n, 3), m, the joints' centres.
        knee_axis: (n, 3), unit vectors of the room.
    """

    time: FloatArray
    markers: FloatArray
    labels: tuple[str, ...]
    hip: FloatArray
    knee: FloatArray
    knee_axis: FloatArray


def walk(seed: int = 1) -> Walk:
    """The trial; another seed is another trial of the same person."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE)) / RATE
    pace = 1 + 0.05 * _slow(rng, (len(time),), 1.0)
    phase = 2 * np.pi * np.cumsum(pace) / RATE / STRIDE

    def wave(mean: float, *harmonics: tuple[float, float]) -> FloatArray:
        """A periodic angle or length: amplitudes and phases of the first and higher harmonics of the stride."""
        waves = (size * np.cos((k + 1) * phase - shift) for k, (size, shift) in enumerate(harmonics))
        return np.asarray(mean + sum(waves))

    # 0 while walking, 1 while circling.
    circling = np.clip((time - STOP) / 0.6, 0, 1)
    circling = circling**2 * (3 - 2 * circling)
    turn = 2 * np.pi * (time - STOP) / CIRCLE

    def mixed(walked: FloatArray, circled: FloatArray | float) -> FloatArray:
        return np.asarray((1 - circling) * walked + circling * circled)

    tilt = mixed(wave(8, (1, 0), (2, 1)), 5 + 3 * np.cos(turn))
    pelvis = Rotation.from_euler(
        "yxz", np.transpose([tilt, mixed(wave(0, (4, 1)), -6), mixed(wave(0, (5, 0)), 0)]), True
    )
    flexion = mixed(wave(-10, (22, 0.2), (4, 2.0)), -15 + 25 * np.cos(turn))
    abduction = mixed(wave(0, (5, 1.5), (2, 0.5)), -15 + 20 * np.sin(turn))
    rotation = mixed(wave(0, (4, 2.5), (2, 1.0)), 8 * np.sin(turn + 1))
    thigh = pelvis * Rotation.from_euler("yxz", np.transpose([flexion, abduction, rotation]), True)
    bend = np.deg2rad(mixed(wave(26, (19, 4.0), (15, 1.2)), 15 - 8 * np.cos(turn)))
    screw = Rotation.from_euler("z", wave(0, (1.0, 1.0))[:, None], True)  # the knee is no perfect hinge
    shank = thigh * Rotation.from_rotvec(bend[:, None] * KNEE_AXIS) * screw
    hip = np.transpose([wave(0, (0.01, 1), (0.02, 0)), wave(-0.08, (0.03, 2)), wave(0.92, (0.002, 0), (0.02, 1))])
    knee = hip + thigh.apply(KNEE)
    segments = (pelvis, hip, PELVIS), (thigh, hip, THIGH), (shank, knee, SHANK)
    labels = tuple(label for names in LABELS for label in names)
    own = OWN * np.array([LOOSE.get(label, 1.0) for label in labels]).reshape(3, 4, 1)
    bodies = [_recorded(rng, phase, segment, size) for segment, size in zip(segments, own, strict=True)]
    return Walk(time, np.concatenate(bodies, axis=1), labels, hip, knee, thigh.apply(KNEE_AXIS))


def _recorded(
    rng: np.random.Generator, phase: FloatArray, segment: tuple[Rotation, FloatArray, FloatArray], own: FloatArray
) -> FloatArray:
    """The markers (n, 4, 3) of a segment, attitude, origin and points, on skin that moves; own (4, 1), m, by itself."""
    turn, place, points = segment
    n = len(phase)
    way = rng.normal(size=(2, 3)) * IN_STEP / 2
    in_step = np.cos(phase)[:, None] * way[0] + np.sin(2 * phase)[:, None] * way[1]
    skin = in_step + SHARED * _slow(rng, (n, 3), SHARED_TIME)
    places = points + skin[:, None] + own * _slow(rng, (n, 4, 3), OWN_TIME)
    seen = place[:, None] + places @ np.swapaxes(turn.as_matrix(), 1, 2)
    return np.asarray(seen + CAMERAS * rng.normal(size=seen.shape))


def _slow(rng: np.random.Generator, shape: tuple[int, ...], seconds: float) -> FloatArray:
    """Noise of first order along the first axis, with standard deviation 1."""
    memory, before = np.exp(-1 / (RATE * seconds)), round(20 * RATE * seconds)
    white = rng.normal(size=(shape[0] + before, *shape[1:])) * np.sqrt(1 - memory**2)
    return np.asarray(lfilter([1], [1, -memory], white, axis=0)[before:])


def main(path: Path) -> None:
    """Write the trial."""
    with replacing(path) as new, new.open("w", encoding="utf-8", newline="") as stream:
        found = walk()
        written = np.round(found.markers, 4)  # to 0.1 mm
        write_trc(FeatureTracks(found.time, written, found.labels), "walking.trc", stream)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: python scripts/examples/walking.py FILE.trc")
    try:
        main(Path(sys.argv[1]))
    except InputError as error:
        raise SystemExit(str(error)) from error
