"""Sessions of any unit: by names, with Booleans, in both versions of FMI, saved and restored."""

import numpy as np
import pytest

from baryscope.fmu import Session, UnitSession, build_fmu
from baryscope.fmu.runtime import UnitError
from baryscope.models.errors import InputError

POINTS = np.array([[0.3, -0.2, 9.0], [-1.0, 0.5, 11.0], [0.8, 0.9, -10.0]])  # the last one is behind the camera


@pytest.fixture(scope="module", params=[(2, False), (3, False), (3, True)], ids=["fmi2", "fmi3", "fmi3-scalar"])
def rig_fmu(request, small, tmp_path_factory):
    fmi, scalar = request.param
    return build_fmu(small, tmp_path_factory.mktemp("rig") / "rig.fmu", unit="rig", fmi=fmi, scalar=scalar)


@pytest.fixture(scope="module")
def controller_fmu(small, tmp_path_factory):
    return build_fmu(small, tmp_path_factory.mktemp("controller") / "controller.fmu", unit="controller")


def test_arrays_and_booleans_by_name(rig_fmu):
    with UnitSession(rig_fmu, {"sampling.period": 2.0, "camera.pixelNoise": 1e-9}) as rig:
        assert not rig["seen"].any()
        rig.step(2.0, {"features": POINTS})
        assert rig["seen"].dtype == bool
        np.testing.assert_array_equal(rig["seen"], [True, True, False])
        np.testing.assert_allclose(rig["points"], POINTS * [[1], [1], [0]], atol=1e-6)
        np.testing.assert_array_equal(rig["camera.measuredAttitude"], [1, 0, 0, 0])  # the start of an input
        rig.set_inputs({"camera.attitude": [0.0, 1.0, 0.0, 0.0]})  # turned about x: it looks back
        rig.step(2.0)
        np.testing.assert_array_equal(rig["seen"], [False, False, True])
        assert rig.time == 4.0
        rig.reset({"sampling.period": 1.0})
        rig.step(1.0)
        np.testing.assert_array_equal(rig["camera.measuredAttitude"], [1, 0, 0, 0])
        assert not rig["seen"].any()


def test_saved_states_hold_everything(rig_fmu):
    with UnitSession(rig_fmu) as rig, UnitSession(rig_fmu, {"seed": 9.0}) as other:
        rig.step(3.0, {"features": POINTS})
        with rig.state() as state:
            content = state.to_bytes()
            rig.step(1.0)
            expected = rig["pixels"]
            rig.restore(state)
            rig.step(1.0)
            np.testing.assert_array_equal(rig["pixels"], expected)
        other.restore(content)
        assert other.time == 3.0
        np.testing.assert_array_equal(other["seen"], [True, True, False])
        other.step(1.0)
        np.testing.assert_array_equal(other["pixels"], expected)


def test_boolean_inputs(controller_fmu):
    with UnitSession(controller_fmu, {"synchronised": True}) as controller:
        controller.step(1.0, {"target.position": [20.0, 3.0, 4.0]})
        assert controller["command.acceleration"].any()
        controller.step(1.0, {"navigation.valid": False})
        assert controller["guidance.mode"] == 2
        controller.tune({"synchronised": False})
        controller.step(1.0, {"navigation.valid": True})
        assert controller["guidance.mode"] == 1
        with pytest.raises(InputError, match=r"navigation\.valid: found nan, expected true or false"):
            controller.step(1.0, {"navigation.valid": np.nan})


def test_what_is_wrong_sets_nothing(rig_fmu):
    with UnitSession(rig_fmu) as rig:
        wrong = [
            ({"features": POINTS, "normal": POINTS}, InputError, "normal: not an input of the unit, expected one of"),
            ({"features": POINTS[:2]}, InputError, r"features: found shape \(2, 3\), expected \(3, 3\)"),
            ({"features": np.where(POINTS > 1, np.nan, POINTS)}, UnitError, "features.* is nan, expected a finite"),
            ({"features": POINTS, "sun.direction": np.zeros(3)}, UnitError, "sun.direction: found length 0"),
        ]
        for inputs, kind, words in wrong[:3]:
            with pytest.raises(kind, match=words):
                rig.step(1.0, inputs)
        rig.step(1.0)
        assert not rig["seen"].any()
        with pytest.raises(wrong[3][1], match=wrong[3][2]):
            rig.step(1.0, wrong[3][0])
        assert rig.time == 1.0


def test_the_target_is_a_unit_too(small_fmu, rig_fmu):
    with UnitSession(small_fmu) as unit, Session(small_fmu) as session:
        unit.step(5.0, {"target.torque": [1.0, 2.0, 3.0]})
        session.step(5.0, torque=[1.0, 2.0, 3.0])
        np.testing.assert_array_equal(unit["features"], session.features)
    with pytest.raises(InputError, match=r"is StereoRig of FMI .*, expected TumblingTarget of FMI 2\.0 or 3\.0"):
        Session(rig_fmu)
