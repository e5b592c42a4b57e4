"""ApproachController in the loop with TumblingTarget: hold, glide, the way around the sphere, a grapple point."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.fmu import Session, build_fmu
from baryscope.fmu.units import blueprint_of
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.scenario import load_scenario
from controlling import (
    GAIN,
    INPUTS,
    LIMIT,
    NOMINAL,
    RATE,
    RECKONING,
    RETREAT,
    SPEED,
    STANDOFF,
    STEP,
    WRONG,
    Controller,
)


@pytest.fixture
def fly(small, small_fmu, controller_fmu, opened):
    """Fly the loop from a place in LVLH; the flight as columns."""

    def flown(start, duration, fmus=(small_fmu, controller_fmu), late=False, fails=np.inf, **parameters):
        told = {"command__steps": 0.0, "grapple__direction": small.features.points[0].normal} | parameters
        controller = opened(Controller, fmus[1], **told)
        rows, before = [], np.zeros(3)
        with Session(fmus[0], {"chaser.position0": start}) as session:
            for _ in range(round(duration / STEP)):
                for name in INPUTS:
                    controller[name] = session[name]
                if session.time >= fails:  # as an estimator that begins anew
                    controller["navigation.valid"] = False
                    controller["target.position"] = controller["target.velocity"] = np.ones(3)
                controller.step()
                command = controller["command.acceleration"]
                rows.append(
                    {
                        "position": session.chaser_position,
                        "velocity": session.chaser_velocity,
                        "command": command,
                        "distance": controller["keepOut.distance"][0],
                        "mode": controller["guidance.mode"][0],
                        "inside": controller["corridor.inside"][0],
                        "feature": session["features"][0],  # from the chaser, as the next two
                        "normal": session["normals"][0],
                        "centre": session["target.position"],
                        "offset": controller["goal.offset"],
                    }
                )
                session.step(STEP, acceleration=before if late else command)
                before = command
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    return flown


@pytest.mark.parametrize("along", [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]], ids=["V-bar", "R-bar"])
def test_a_glide_is_straight(fly, along):
    """From rest, s = v t − (v/k) (1 − exp(−k t)) while the speed is limited; at last exp(−λ t) to the goal."""
    along = np.array(along)
    flight = fly(40 * along, 600, hold__position=30 * along)
    way, aside = flight["position"] @ along, np.linalg.norm(np.cross(flight["position"], along), axis=1)
    assert aside.max() < 2e-3
    t = 40.0
    gone = SPEED * t - SPEED / GAIN * (1 - np.exp(-GAIN * t))
    assert 40 - way[int(t / STEP)] == pytest.approx(gone, abs=2 * SPEED * STEP)
    left = way - 30
    assert left[700] / left[600] == pytest.approx(np.exp(-RATE * 50), rel=0.05)
    assert np.linalg.norm(flight["velocity"], axis=1).max() < SPEED * (1 + 1e-3)
    assert 0 < left[-1] < 1e-3


def test_a_hold_on_an_eccentric_orbit(small, fly, tmp_path):
    """On R-bar, where it takes thrust to stay: through the periapsis of e = 0.3, to millimetres."""
    orbit = replace(small.orbit, eccentricity=0.3, semi_major_axis=12e6, true_anomaly=np.deg2rad(350.0))
    eccentric = small.model_copy(update={"orbit": orbit})
    fmus = build_fmu(eccentric, tmp_path / "t.fmu"), build_fmu(eccentric, tmp_path / "c.fmu", unit="controller")
    place = [-200.0, 0.0, 0.0]
    flight = fly(place, 600, fmus, hold__position=place)
    assert np.abs(flight["position"] - place).max() < 5e-3
    assert np.linalg.norm(flight["command"], axis=1).min() > 1e-4


def test_the_sphere_is_gone_around(fly):
    """To the other side, a little off the line through the centre."""
    flight = fly([0.0, -20.0, 0.0], 1200, hold__position=[5.0, 20.0, 0.0], keepOut__radius=12.0)
    assert np.linalg.norm(flight["position"], axis=1).min() > 12.0 - 1e-3
    assert np.linalg.norm(flight["position"][-1] - [5.0, 20.0, 0.0]) < 1e-2


def test_a_goal_inside_the_sphere_is_not_reached(fly):
    flight = fly([0.0, -20.0, 0.0], 800, hold__position=[0.0, -5.0, 0.0], keepOut__radius=12.0)
    assert np.linalg.norm(flight["position"][-1] - [0.0, -12.0, 0.0]) < 1e-2


def test_a_command_that_comes_a_step_late(fly):
    """As of masters that hand outputs on in the next step; not told of it, the chaser misses by more."""
    flights = {
        steps: fly([0.0, -20.0, 0.0], 900, late=True, synchronised=True, command__steps=steps) for steps in (0.0, 1.0)
    }
    off = {
        steps: np.linalg.norm(flight["feature"] + STANDOFF * flight["normal"], axis=1)[-400:]
        for steps, flight in flights.items()
    }
    assert off[1.0].max() < 0.02
    assert off[1.0][-100:].max() < 3e-3  # once it has come to rest in the body's axes
    assert off[0.0].min() > 0.04


def test_a_delay_is_as_good_as_steps(controller_fmu, opened):
    """A step later, or as many seconds."""
    found = []
    for steps, delay in [(1.0, 0.0), (0.0, STEP), (0.0, 0.0)]:
        controller = opened(Controller, controller_fmu, synchronised=True, command__steps=steps, command__delay=delay)
        controller["target.position"] = [12.0, 3.0, 4.0]
        controller["target.angularRate"] = [0.05, 0.02, 0.03]
        controller.step()
        found.append(controller["command.acceleration"])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-14)
    assert np.abs(found[0] - found[2]).max() > 1e-5


def test_the_limit_is_enough_to_go_around_with_the_body(envisat):
    """0.05 m/s² for Envisat; the upper stage takes more than that to be followed at its grapple point."""
    stage = load_scenario("upper-stage")
    limits = {one.name: blueprint_of("controller", one).starts["thrust.limit"] for one in (envisat, stage)}
    assert limits["envisat"] == LIMIT
    rate = np.deg2rad(np.linalg.norm(stage.target.angular_rate_deg))
    reach = np.linalg.norm(stage.features.points[0].position) + STANDOFF
    assert LIMIT < rate**2 * reach < limits["upper-stage"] < 2 * rate**2 * reach


@pytest.mark.parametrize("steps, delay", [(1.0, 0.0), (0.0, 0.0), (2.0, 0.3)])
def test_thrusters_that_are_wrong_are_told_another_command(controller_fmu, opened, small, steps, delay):
    """By scipy's rotations they push as right ones, where the camera is as the command acts.

    The camera is told as late by steps as the command, and turns on by its delay and half a step, about the axis of the
    line of sight, which goes round a great circle; LVLH turns on from the inputs to then.
    """
    found, place, rate = {}, np.array([12.0, 3.0, 4.0]), np.array([0.02, -0.05, 0.03])
    rate -= rate @ place / (place @ place) * place
    for error in (np.zeros(4), WRONG):
        controller = opened(
            Controller, controller_fmu, synchronised=True, command__steps=steps, command__delay=delay, thrust__limit=1.0
        )
        controller["target.position"], controller["target.velocity"] = place, np.cross(rate, place)
        controller["thrust.error"] = error
        controller.step()
        found[error.any()] = controller["command.acceleration"]
    told = Rotation.from_quat(controller["camera.attitude"], scalar_first=True)
    R_I_V = Rotation.from_rotvec(rate * (delay + STEP / 2)) * told
    acts = np.array([steps * STEP + delay + STEP / 2])
    R_L_V = Rotation.from_matrix(lvlh_attitude(small.orbit, acts)[0]).inv() * R_I_V
    pushed = (1 + WRONG[0]) * (R_L_V * Rotation.from_rotvec(WRONG[1:]) * R_L_V.inv()).apply(found[True])
    # L's rate changes by e n², 1e-9 rad/s² on this orbit, in a second or two; and what is wrong of m is at most WRONG.
    np.testing.assert_allclose(pushed, found[False], rtol=0, atol=1e-9 * np.linalg.norm(pushed))
    assert np.linalg.norm(found[True] - found[False]) > 0.05 * np.linalg.norm(pushed)


def test_the_limit_is_of_what_thrusters_are_told(controller_fmu, opened):
    """Weak ones are told more than they push by, and no more than the limit."""
    controller = opened(Controller, controller_fmu, hold__position=[0.0, -10.0, 0.0], thrust__limit=1.0)
    controller["target.position"], controller["target.velocity"] = [20.0, 3.0, 4.0], [0.2, 0.0, 0.0]
    controller.step()
    size = np.linalg.norm(controller["command.acceleration"])
    controller.set("thrust.limit", 1.1 * size)
    for scale, expected in [(-0.05, size / 0.95), (-0.2, 1.1 * size), (-1.0, 1.1 * size), (-2.0, 1.1 * size)]:
        controller["thrust.error"] = [scale, 0.0, 0.0, 0.0]
        controller.step()
        # LVLH goes on by up to 1.1 mrad/s, and time by a few steps: by as much the command is another one.
        assert np.linalg.norm(controller["command.acceleration"]) == pytest.approx(expected, rel=5e-3)
        assert controller["command.limited"] == (scale < -0.1)


def test_dead_reckoning_goes_by_what_thrusters_push(controller_fmu, opened):
    """Whatever they are told for that: as if they were right, and were told what they push by."""
    near = {"keepOut__radius": 11.0, "thrust__limit": 1.0}  # so that it does not coast
    one, other = (opened(Controller, controller_fmu, **near) for _ in range(2))
    one["thrust.error"] = WRONG
    for controller in (one, other):
        controller["target.position"], controller["target.velocity"] = [11.0, 3.0, 4.0], [-0.1, 0.0, 0.0]
        controller.step()
        controller["navigation.valid"] = False
    one["thrust.error"] = np.ones(4)  # of an estimator that is not valid: what it told before holds
    for _ in range(8):
        one.step(), other.step()
        assert other["guidance.mode"] == RECKONING
        np.testing.assert_allclose(one["goal.offset"], other["goal.offset"], rtol=0, atol=1e-12)
        told, right = (np.linalg.norm(controller["command.acceleration"]) for controller in (one, other))
        assert told == pytest.approx(right / (1 + WRONG[0]), rel=1e-9)
        assert right > 0


@pytest.mark.parametrize("told", [True, False], ids=["along the normal", "away from the CoM"])
def test_an_approach_to_a_grapple_point(fly, told):
    """Envisat at 3.5 °/s: around on the sphere, in through the corridor, and at rest in the body's axes."""
    flight = fly([0.0, -20.0, 0.0], 900, synchronised=True, **({} if told else {"grapple__direction": np.zeros(3)}))
    outside = ~flight["inside"].astype(bool)
    assert outside[0]
    assert not outside[-1]
    assert flight["distance"][outside].min() > -0.02
    assert np.linalg.norm(flight["command"], axis=1).max() < LIMIT * (1 + 1e-12)
    away = flight["feature"] - flight["centre"]
    direction = flight["normal"] if told else away / np.linalg.norm(away, axis=1, keepdims=True)
    off = np.linalg.norm(flight["feature"] + STANDOFF * direction, axis=1)[-400:]  # 200 s, nearly two turns
    assert off.max() < 0.02
    assert off[-100:].max() < 3e-3
    np.testing.assert_allclose(off, np.linalg.norm(flight["offset"][-400:], axis=1), atol=1e-9)


@pytest.mark.parametrize("standoff", [0.0, 0.05])
def test_a_goal_at_the_grapple_point_itself_is_kept(fly, standoff):
    """The corridor has room about the goal: where it is a point, each millimetre aside would lead out of the sphere."""
    flight = fly([0.0, -20.0, 0.0], 1100, synchronised=True, grapple__standoff=standoff)
    off = np.linalg.norm(flight["feature"] + standoff * flight["normal"], axis=1)[-600:]
    assert flight["inside"][-600:].all()
    assert off.max() < 0.02
    assert off[-100:].max() < 3e-3


@pytest.mark.parametrize("unknown", ["target.inertia", "grapple.point"])
def test_before_the_tumble_is_known_it_waits(controller_fmu, opened, unknown):
    """An estimator tells zeros till then."""
    controller = opened(Controller, controller_fmu, synchronised=True, hold__position=[0.0, -10.0, 0.0])
    controller["target.position"] = [20.0, 3.0, 4.0]
    told = controller[unknown]
    controller[unknown] = np.zeros(len(told))
    controller.step()
    assert not controller["goal.synchronised"]
    waiting = controller["command.acceleration"]
    controller["synchronised"] = False
    controller.step()
    turned = LIMIT * 1.1e-3 * STEP  # LVLH goes on by up to 1.1 mrad/s
    np.testing.assert_allclose(controller["command.acceleration"], waiting, atol=turned)
    controller["synchronised"], controller[unknown] = True, told
    controller.step()
    assert controller["goal.synchronised"]


def test_a_glide_whose_navigation_fails_does_not_end_in_the_target(fly):
    """It went on at 0.1 m/s without a command, through the target. It has to stop, go back to 20 m, and stay there."""
    flight = fly([0.0, -40.0, 0.0], 900, fails=200.0, hold__position=[0.0, -12.0, 0.0])
    distance = np.linalg.norm(flight["position"], axis=1)
    assert [*dict.fromkeys(flight["mode"])] == [NOMINAL, RECKONING, RETREAT]
    assert not flight["command"][flight["mode"] == RECKONING].any()  # 20 s of it lead nowhere near the sphere
    assert distance.min() > 17.5  # after 20 s of patience
    assert np.linalg.norm(flight["position"][-1] - [0.0, -20.0, 0.0]) < 0.5
    assert np.linalg.norm(flight["velocity"][-200:], axis=1).max() < 2e-3


def test_a_chaser_in_the_corridor_backs_out_of_it_with_the_body(fly):
    """Navigation fails 2 m before the grapple point: along the axis as it turns, and then away to 20 m, at rest.

    Nothing of the body comes nearer than the feature there was, and the sphere stays clear from then on.
    """
    flight = fly([0.0, -20.0, 0.0], 1500, fails=850.0, synchronised=True)
    failed, distance = round(850 / STEP), np.linalg.norm(flight["position"], axis=1)
    assert np.linalg.norm(flight["feature"], axis=1)[: failed + 200].min() > STANDOFF - 0.02
    assert flight["command"][failed : failed + 20].any(axis=1).all()  # in the sphere it does not coast
    leaves = failed + int(np.argmax(distance[failed:] > 10.0))
    assert leaves - failed < 60 / STEP
    aside = np.cross(flight["feature"], flight["normal"])
    assert np.linalg.norm(aside[failed:leaves], axis=1).max() < 0.15  # beside the axis
    assert distance[leaves:].min() > 10.0 - 1e-3
    assert distance[-1] == pytest.approx(20.0, abs=0.5)
    assert np.linalg.norm(flight["velocity"][-1]) < 5e-3
    assert np.linalg.norm(flight["command"], axis=1).max() < LIMIT * (1 + 1e-12)
