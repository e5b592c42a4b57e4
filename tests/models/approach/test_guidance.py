"""The field of velocities at places where it is known, and the law's derivative of it against differences."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.approach.guidance import Goal, Limits, Motion, commanded, glide_velocity

SPEED, RATE, RADIUS, GAIN = 0.1, 0.02, 8.0, 0.2
APEX, AXIS = np.array([2.0, 1.0, -1.0]), np.array([2.0, -1.0, 2.0]) / 3
STANDOFF = 1.5
TURNING, TURNING_RATE = np.array([0.02, -0.05, 0.03]), np.array([1e-4, 3e-4, -2e-4])


def limits(radius=RADIUS, degrees=20.0):
    return Limits(*(ca.SX(value) for value in (SPEED, RATE, radius, np.cos(np.deg2rad(degrees)))))


def hold(position):
    zero = ca.SX.zeros(3)
    return Goal(ca.SX(position), zero, ca.SX([1, 0, 0]), zero, zero, ca.SX(0))


def turning(after=0.0):
    """A goal before a grapple point, and the same a little later."""
    R = Rotation.from_rotvec(after * TURNING + after**2 / 2 * TURNING_RATE)
    vectors = [R.apply(v) for v in (APEX + STANDOFF * AXIS, APEX, AXIS)]
    return Goal(*(ca.SX(v) for v in (*vectors, TURNING + after * TURNING_RATE, TURNING_RATE)), ca.SX(1))


def field(position, goal, bounds=None):
    return np.array(ca.evalf(glide_velocity(ca.SX(position), goal, bounds or limits()))).ravel()


def test_far_away_it_has_the_speed_and_near_the_rate():
    np.testing.assert_allclose(field([0, -40.0, 0], hold([0, -30.0, 0])), [0, SPEED, 0], atol=1e-12)
    np.testing.assert_allclose(field([0, -31.0, 0], hold([0, -30.0, 0])), [0, RATE, 0], atol=1e-12)
    np.testing.assert_allclose(field([0, -30.0, 0], hold([0, -30.0, 0])), 0, atol=1e-12)


def test_towards_the_sphere_it_slows_and_inside_it_leads_out():
    """λ (|ρ| − R): 0.02 m/s a metre away, nothing on it, 0.02 m/s outwards a metre inside."""
    goal = hold([0, 30.0, 0])
    for distance, outward in ((RADIUS + 1, -RATE), (RADIUS, 0.0), (RADIUS - 1, RATE)):
        np.testing.assert_allclose(field([0, -distance, 0], goal), [0, -outward, 0], atol=1e-12)
    np.testing.assert_allclose(field([0, -RADIUS + 1, 0], goal, limits(radius=0.0)), [0, SPEED, 0], atol=1e-12)
    # Beside the line to the goal it slides: what is along the sphere stays.
    beside = RADIUS * np.array([np.sin(0.3), -np.cos(0.3), 0])
    found = field(beside, goal)
    assert found @ beside == pytest.approx(0, abs=1e-12)
    free = field(beside, goal, limits(radius=0.0))
    np.testing.assert_allclose(found, free - (free @ beside) * beside / RADIUS**2, atol=1e-12)


def test_a_goal_that_turns_is_entered_through_its_corridor():
    """In the body the way leads to where the axis leaves the sphere, and from there in; there the place turns along."""
    along = APEX @ AXIS
    entry = APEX + (np.sqrt(along**2 + RADIUS**2 - APEX @ APEX) - along) * AXIS
    assert np.linalg.norm(entry) == pytest.approx(RADIUS)
    np.testing.assert_allclose(field(entry, turning()) - np.cross(TURNING, entry), -SPEED * AXIS, atol=1e-12)
    aside = Rotation.from_rotvec([0, 0, 1.0]).apply(entry)
    way = field(aside, turning()) - np.cross(TURNING, aside)
    outward = aside / RADIUS
    straight = SPEED * (entry - aside) / np.linalg.norm(entry - aside)
    np.testing.assert_allclose(way, straight - (straight @ outward) * outward, atol=1e-9)
    np.testing.assert_allclose(
        field(APEX + STANDOFF * AXIS, turning()), np.cross(TURNING, APEX + STANDOFF * AXIS), atol=1e-12
    )
    far = 3 * aside  # the place turns as fast as one on the sphere
    np.testing.assert_allclose(
        field(far, turning()) - np.cross(TURNING, aside), SPEED * (entry - far) / np.linalg.norm(entry - far), atol=1e-9
    )


@pytest.mark.parametrize(
    "place", [[3.0, -9.0, 4.0], [4.0, 0.2, 1.0], [3.1, 0.5, 0.1], [20.0, 3.0, -5.0], [-6.0, 2.0, 1.0]]
)
@pytest.mark.parametrize("goal", [turning, lambda after=0.0: hold([1.0, 12.0, 2.0])], ids=["turning", "hold"])
def test_the_command_follows_the_field(place, goal):
    """u + n − k (w − ρ̇) is the change of w as the chaser moves and the goal turns, by central differences."""
    place, velocity, natural = np.array(place), np.array([0.03, -0.02, 0.05]), np.array([1e-4, 2e-4, 3e-4])
    motion = Motion(*(ca.SX(v) for v in (place, velocity, natural)))
    u = np.array(ca.evalf(commanded(motion, goal(), limits(), ca.SX(GAIN)))).ravel()
    h = 1e-3
    ahead, behind = (field(place + after * velocity, goal(after)) for after in (h, -h))
    change = (ahead - behind) / (2 * h)
    np.testing.assert_allclose(u + natural - GAIN * (field(place, goal()) - velocity), change, atol=1e-8)
