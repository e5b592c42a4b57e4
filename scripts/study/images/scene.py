"""A draw: the truth of a flight, the pair of cameras that watches it, and the images that these take.

The preset cubesat-class, its chaser 5 m away on V-bar: attitude, direction of the spin, Sun, textures and noise are
drawn. The cameras turn with the chaser, point between them at the target, and are turned towards one another.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.lens import Lens, RightLens
from baryscope.estimator.camera.pair import CameraPair
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.geometry.alignment import matrix_from_quaternion, quaternion_from_matrix
from baryscope.estimator.images.opencv import opencv
from baryscope.models.files import AnyPath
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.study.flight import fly
from baryscope.study.images.body import Facet, satellite
from baryscope.study.images.render import View, exposed, render

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]

BASELINE = 0.3  # m
TOE_IN = np.deg2rad(1.5)  # of each camera, about its y
TILT = np.deg2rad(0.2)  # of the right camera about its x and z: no pair is parallel as built
FOCAL_LENGTH = 1500 / 640  # widths of the image
HEIGHT = 3 / 4  # of the width
DISTORTION = (-0.1, 0.02, 3e-4, -2e-4, 0.0)
NOISE = 2.0  # of a pixel, in steps of 8 bits
EXPOSURE = 1.1
LEVER_ARM = np.array([0.0, 0.0, 0.25])  # m, of the middle of the baseline from the chaser's CoM, in the rig's axes
MOST_OBLIQUE = np.deg2rad(60)  # angle between the Sun and the direction to the chaser, at most


@dataclass(frozen=True)
class Setting:
    """How long the target is watched, s, and how often, Hz; width of the images, px; noise of a pixel, in steps of 8
    bits.
    """

    duration: float = 30.0
    rate: float = 2.0
    width: int = 640
    noise: float = NOISE


@dataclass(frozen=True, eq=False)
class Scene:
    """orbit of the target; time (n,) s; path (n, 3) of the centre of mass in C, m; attitude (n, 3, 3) R_C_B; camera:
    the left one's attitude and place; pair: the lenses; sun (3,): unit vector to the Sun in C; body; seed of the noise.
    """

    orbit: Orbit
    time: FloatArray
    path: FloatArray
    attitude: FloatArray
    camera: Camera
    pair: CameraPair
    sun: FloatArray
    body: tuple[Facet, ...]
    noise: float
    seed: np.random.SeedSequence

    @cached_property
    def views(self) -> tuple[View, View]:
        """The rays of both cameras."""
        return View.of(self.pair.left), View.of(self.pair.right)

    def images(self) -> Iterator[tuple[Image, Image]]:
        """The pairs of images, one after the other."""
        known = self.camera.errors(self.time)
        turn, place = self.pair.R_left_right, np.array(self.pair.right.position)
        rng = np.random.default_rng(self.seed)
        for R_C_V, place_C, R_C_B, path in zip(known.attitude, known.place, self.attitude, self.path, strict=True):
            R_V_B, origin_V, sun_V = R_C_V.T @ R_C_B, R_C_V.T @ (path - place_C), R_C_V.T @ self.sun
            left = render(self.body, self.views[0], R_V_B, origin_V, sun_V)
            right = render(self.body, self.views[1], turn.T @ R_V_B, turn.T @ (origin_V - place), turn.T @ sun_V)
            yield exposed(EXPOSURE * left, self.noise, rng), exposed(EXPOSURE * right, self.noise, rng)


def drawn(seed: int, setting: Setting | None = None, unit: AnyPath | None = None) -> Scene:
    """A draw; the same seed gives the same motion and light whatever the noise.

    unit: an FMU of the preset cubesat-class, built on the spot unless given.
    """
    setting = setting or Setting()
    of_motion, of_images = np.random.SeedSequence(seed).spawn(2)
    scenario = _scenario(setting, np.random.default_rng(of_motion))
    truth = fly(scenario, unit).truth
    attitude = matrix_from_quaternion(truth["target.attitude"])
    return watched(setting, scenario.orbit, (truth.time, truth["target.position"], attitude), of_images)


def watched(
    setting: Setting, orbit: Orbit, truth: tuple[FloatArray, FloatArray, FloatArray], seed: np.random.SeedSequence
) -> Scene:
    """The scene of a motion: truth has times (n,), the path (n, 3) and the attitude (n, 3, 3), see `Scene`."""
    of_light, of_body, of_noise = seed.spawn(3)
    time, path, attitude = truth
    pair, R_rig_left = _pair(setting.width)
    x, y, z = (R_rig_left.T @ (LEVER_ARM - np.array([BASELINE / 2, 0.0, 0.0]))).tolist()
    turning = AttitudeSeries(time, quaternion_from_matrix(rig_axes(orbit, time, path) @ R_rig_left))
    return Scene(
        orbit=orbit,
        time=time,
        path=path,
        attitude=attitude,
        camera=Camera(turning, Rig(lever_arm=(x, y, z))),
        pair=pair,
        sun=_sun(path[0], np.random.default_rng(of_light)),
        body=satellite(int(of_body.generate_state(1)[0])),
        noise=setting.noise,
        seed=of_noise,
    )


def rig_axes(orbit: Orbit, time: FloatArray, target: FloatArray) -> FloatArray:
    """The rig's axes (n, 3, 3) in C: z at the target's path (n, 3), y along the orbit's normal, downwards in images."""
    ahead = target / np.linalg.norm(target, axis=1, keepdims=True)
    normal = lvlh_attitude(orbit, time)[:, :, 2]
    side = np.cross(normal, ahead)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return np.stack([side, np.cross(ahead, side), ahead], axis=2)


def write_images(scene: Scene, folder: Path) -> tuple[Path, Path]:
    """Write the images as numbered PNG files in the folders left and right of a folder."""
    cv2 = opencv()
    sides = (folder / "left", folder / "right")
    for side in sides:
        side.mkdir(parents=True, exist_ok=True)
    for number, images in enumerate(scene.images()):
        for side, image in zip(sides, images, strict=True):
            cv2.imwrite(str(side / f"{number:05d}.png"), image)
    return sides


def rig_text(scene: Scene) -> str:
    """The rig file of a scene."""
    lines = ["[rig]", f"lever_arm = {list(scene.camera.rig.lever_arm)}"]
    for name, lens in (("left", scene.pair.left), ("right", scene.pair.right)):
        lines += ["", f"[rig.{name}]"]
        lines += [f"{field} = {list(value)}" for field, value in lens.model_dump().items()]
    return "\n".join(lines) + "\n"


def _scenario(setting: Setting, rng: np.random.Generator) -> Scenario:
    preset = load_scenario("cubesat-class")
    x, y, z, w = Rotation.random(random_state=rng).as_quat().tolist()
    rate = np.linalg.norm(preset.target.angular_rate_deg) * _direction(rng)
    target = preset.target.model_copy(update={"attitude": (w, x, y, z), "angular_rate_deg": tuple(rate.tolist())})
    run = preset.run.model_copy(update={"duration": setting.duration, "sample_time": 1 / setting.rate})
    return preset.model_copy(update={"target": target, "run": run})


def _pair(width: int) -> tuple[CameraPair, FloatArray]:
    """The pair, and the left camera's axes in the rig's."""
    R_rig_left = Rotation.from_rotvec([0.0, TOE_IN, 0.0]).as_matrix()
    R_rig_right = (
        Rotation.from_rotvec([0.0, -TOE_IN, 0.0]).as_matrix() @ Rotation.from_rotvec([TILT, 0, TILT]).as_matrix()
    )
    size, focal_length = (width, int(HEIGHT * width)), FOCAL_LENGTH * width
    centre = (size[0] / 2 - 0.5, size[1] / 2 - 0.5)
    lens = Lens(
        focal_length=(focal_length, focal_length), principal_point=centre, resolution=size, distortion=DISTORTION
    )
    x, y, z = (R_rig_left.T @ np.array([BASELINE, 0.0, 0.0])).tolist()
    turned = quaternion_from_matrix((R_rig_left.T @ R_rig_right)[None])[0].tolist()
    right = RightLens(**lens.model_dump(), position=(x, y, z), mounting=tuple(turned))
    return CameraPair(lens, right), R_rig_left


def _sun(target: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A direction to the Sun from which the side of the target that is seen is lit."""
    back = -target / np.linalg.norm(target)
    while True:
        sun = _direction(rng)
        if sun @ back > np.cos(MOST_OBLIQUE):
            return sun


def _direction(rng: np.random.Generator) -> FloatArray:
    direction = rng.standard_normal(3)
    return np.asarray(direction / np.linalg.norm(direction))
