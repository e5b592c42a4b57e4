"""ApproachController by itself: what it does where navigation fails, what it keeps, and where its camera looks."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controlling import INPUTS, LIMIT, RECKONING, RETREAT, STEP, WAITING, WRONG, Controller


def test_a_retreat_has_an_end(controller_fmu, opened):
    """The worse the estimate the farther, but no more than retreat.farthest: 500 m of deviation led 1520 m away, where
    nothing is seen and the estimate gets worse. Who is farther stays.
    """
    controller = opened(
        Controller, controller_fmu, keepOut__radius=19.0, retreat__distance=20.0, retreat__farthest=30.0
    )
    controller["target.position"] = [0.0, 20.0, 0.0]
    controller.step()
    controller.set("navigation.patience", 0.0)
    for deviation, place, goal in [(2.0, 20.0, 26.0), (5.0, 20.0, 30.0), (500.0, 20.0, 30.0), (500.0, 45.0, 45.0)]:
        controller["target.position"] = [0.0, place, 0.0]
        controller["target.positionCovariance"] = [deviation**2, 0.0, 0.0, 0.0, 0.0, 0.0]
        controller.step()
        assert controller["guidance.mode"] == RETREAT
        assert np.linalg.norm(controller["goal.offset"]) == pytest.approx(goal - place, abs=1e-9)
    controller.set("retreat.farthest", 5.0)
    controller["target.position"] = [0.0, 15.0, 0.0]
    controller.step()
    assert np.linalg.norm(controller["goal.offset"]) == pytest.approx(20.0 - 15.0, abs=1e-9)


def test_in_a_retreat_counts_what_is_told_if_it_claims_less(controller_fmu, opened):
    """Navigation fails with a velocity that is wrong by 0.5 m/s, and the chaser, 20 m away, does not move: dead
    reckoning alone has it nearer by that, for ever, and leaves by as much. An estimator that starts again tells.
    """
    controller = opened(Controller, controller_fmu, keepOut__radius=2.0, navigation__patience=10.0)

    def told(deviation, **others):
        controller["target.positionCovariance"] = [deviation**2, 0.0, 0.0, 0.0, 0.0, 0.0]
        controller["target.position"] = [0.0, 20.0, 0.0]
        for name, value in others.items():
            controller[name.replace("__", ".")] = value
        controller.step()
        return controller["guidance.mode"][0], controller["keepOut.distance"][0]

    told(0.3, target__velocity=[0.0, -0.5, 0.0])
    told(0.1, navigation__valid=False, target__velocity=np.zeros(3))
    for _ in range(18):
        mode, distance = told(0.1)  # which cannot be trusted yet
        assert mode == RECKONING
    assert distance == pytest.approx(18.0 - 0.5 * 19 * STEP, abs=0.3)
    for deviation in (0.0, 1.0):  # not told, or less known than what is carried on
        for _ in range(2):
            mode, distance = told(deviation)
    assert (mode, distance) == (RETREAT, pytest.approx(18.0 - 0.5 * 23 * STEP, abs=0.6))
    mode, distance = told(0.2)
    assert (mode, distance) == (RETREAT, pytest.approx(18.0, abs=1e-9))


def test_what_it_goes_on_with_is_in_saved_states_and_gone_after_a_reset(controller_fmu, opened):
    """Restored in another instance, dead reckoning goes on to the last bit."""
    one, other = (opened(Controller, controller_fmu, navigation__patience=3.0) for _ in range(2))
    one["target.position"], one["target.velocity"] = [12.0, 3.0, 4.0], [0.1, -0.2, 0.05]
    one["thrust.error"] = WRONG
    one.step()
    one["navigation.valid"] = other["navigation.valid"] = False
    one.step()
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(one.fmu.serializeFMUstate(one.fmu.getFMUstate())))
    other.time = one.time
    modes = []
    for _ in range(8):
        one.step(), other.step()
        for name in ("command.acceleration", "camera.attitude", "guidance.mode", "goal.offset"):
            np.testing.assert_array_equal(one[name], other[name])
        modes.append(one["guidance.mode"][0])
    assert modes == [RECKONING] * 5 + [RETREAT] * 3
    other.fmu.reset()
    other["navigation.valid"] = False
    other.initialise(0.0)
    other.time = 0.0
    other.step()
    assert other["guidance.mode"] == WAITING
    assert not other["command.acceleration"].any()


def test_without_navigation_yet_there_is_no_command(controller_fmu, opened):
    controller = opened(Controller, controller_fmu, hold__position=[0.0, -10.0, 0.0])
    controller["target.position"] = [20.0, 3.0, 4.0]
    controller["navigation.valid"] = False
    controller.step()
    assert not controller["command.acceleration"].any()
    assert controller["guidance.mode"] == WAITING
    controller["target.velocity"] = [3.0, 0.0, 0.0]
    controller["navigation.valid"] = True
    controller.step()
    assert np.linalg.norm(controller["command.acceleration"]) == pytest.approx(LIMIT, rel=1e-12)
    assert controller["command.limited"]
    controller["target.attitude"] = np.zeros(4)
    controller.step()  # which has no part in a hold
    controller["synchronised"] = True
    controller.refused(controller.step, "no finite outputs: a vector without length")
    controller.refused(
        lambda: controller.set("guidance.speed", 0.0), "guidance.speed: found value 0, expected a value above 0"
    )
    controller.refused(lambda: controller.set("orbit.eccentricity", 0.1), "orbit.eccentricity is fixed")
    for name in ("navigation.patience", "navigation.deviation", "retreat.distance", "retreat.farthest"):
        controller.refused(lambda name=name: controller.set(name, -1.0), f"{name}: found value -1, expected a value of")


def test_the_camera_looks_at_the_target_where_it_was_seen_or_where_it_will_be(controller_fmu, opened, small):
    """z ahead; with all inputs zero, as in some masters' first step, from where the chaser starts.

    It was from where it is to hold: on the other side of the target the camera looked away from that for good.
    """
    start = [0.0, -20.0, 0.0]
    controller = opened(Controller, controller_fmu, chaser__position0=start, hold__position=[0.0, 15.0, 0.0])
    orbit = small.orbit
    normal = Rotation.from_euler("ZXZ", [orbit.raan, orbit.inclination, 0.0]).as_matrix()[:, 2]
    along = Rotation.from_euler(
        "ZXZ", [orbit.raan, orbit.inclination, orbit.argument_of_periapsis + orbit.true_anomaly]
    ).as_matrix()[:, 1]

    def axes():
        controller.step()
        return Rotation.from_quat(controller["camera.attitude"], scalar_first=True).as_matrix()

    for name in (*INPUTS, "target.inertia"):
        controller[name] = np.zeros(len(controller.places(name)))
    controller["navigation.valid"] = False
    R = axes()
    np.testing.assert_allclose(R[:, 2], along, atol=1e-9)  # ahead on V-bar
    np.testing.assert_allclose(controller["command.acceleration"], 0.0)
    for direction in (np.array([3.0, -5.0, 2.0]), normal):
        controller["target.position"] = direction
        R = axes()
        np.testing.assert_allclose(R[:, 2], direction / np.linalg.norm(direction), atol=1e-9)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
        assert np.linalg.det(R) == pytest.approx(1.0)
    controller["sight.position"] = seen = np.array([1.0, 2.0, 2.0])  # an estimate that is not valid may be far from it
    np.testing.assert_allclose(axes()[:, 2], seen / 3.0, atol=1e-9)
    controller["navigation.valid"] = True
    np.testing.assert_allclose(axes()[:, 2], direction / np.linalg.norm(direction), atol=1e-9)
    # Then it fails, with a sight that is no news: the target is looked for where dead reckoning has it.
    controller["target.position"], controller["target.velocity"] = [0.0, 20.0, 0.0], [2.0, 0.0, 0.0]
    axes()
    controller["navigation.valid"], controller["target.position"] = False, direction
    axes()
    assert axes()[:, 2] @ [0.1, 1.0, 0.0] > 0.99 * np.sqrt(1.01)
    controller["sight.position"] = seen = np.array([3.0, 2.0, 2.0])
    assert axes()[:, 2] @ [0.15, 1.0, 0.0] > 0.99 * np.sqrt(1.02)  # frames that fit nowhere turn no camera
    controller["navigation.patience"] = 0.0
    axes()
    controller["sight.position"] = seen = np.array([3.0, 2.0, 2.5])
    np.testing.assert_allclose(axes()[:, 2], seen / np.linalg.norm(seen), atol=1e-9)


def test_the_camera_does_not_roll(controller_fmu, opened, small):
    """The line of sight goes round a great circle, over the orbit's normal: the camera turns by as much.

    It leapt by 90 degrees as the line of sight came within 25 degrees of the normal, as no chaser turns in a step. The
    closed form is that of parallel transport: along a great circle it is the rotation about that one's axis.
    """
    controller = opened(Controller, controller_fmu, hold__position=[0.0, -20.0, 0.0])
    orbit = small.orbit
    normal = Rotation.from_euler("ZXZ", [orbit.raan, orbit.inclination, 0.0]).as_matrix()[:, 2]
    axis = np.cross(normal, [0.3, -0.8, 0.5])
    axis /= np.linalg.norm(axis)
    turns = Rotation.from_rotvec(np.linspace(0.0, 2 * np.pi, 121)[:, None] * axis)
    seen = []
    for direction in turns.apply(np.cross(axis, normal)):
        controller["target.position"] = 10 * direction
        controller.step()
        seen.append(Rotation.from_quat(controller["camera.attitude"], scalar_first=True))
    for turn, view in zip(turns, seen, strict=True):
        assert (view * (turn * seen[0]).inv()).magnitude() < 1e-9
