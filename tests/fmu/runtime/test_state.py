"""Saved states of a session, and parameters tuned during a run, in every form of the unit."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from baryscope.fmu import SavedState, Session
from baryscope.fmu.runtime.session import UnitError
from baryscope.models.errors import InputError


def run(session, steps=40):
    """Some steps with and without thrust; times and outputs, to be compared bitwise."""
    found = []
    for k in range(steps):
        if k % 7 == 3:
            session.set_inputs(acceleration=[1e-3 * k, 0.0, 0.0])
        session.step(0.1, torque=[0.5, 0.0, -0.25] if k == 11 else None)
        found.append([session.time.hex(), *(value.hex() for value in session.outputs.tolist())])
    return found


def test_a_restored_session_continues_bitwise(any_fmu):
    with Session(any_fmu) as session:
        run(session)
        with session.state() as state:
            expected = run(session)
            for _ in range(2):
                session.restore(state)
                assert session.time == state.time == pytest.approx(4.0)
                assert run(session) == expected


def test_restoring_brings_inputs_parameters_and_outputs_back(any_fmu):
    with Session(any_fmu) as session:
        session.step(1.0, torque=[1.0, 2.0, 3.0])
        outputs, state = session.outputs.copy(), session.state()
        assert isinstance(state, SavedState)
        session.step(1.0)
        after = session.outputs.copy()
        session.step(1.0, torque=[0.0] * 3)
        session.tune({"gravityGradient": True, "solver.tolerance": 1e-9})
        session.restore(state)
        assert np.array_equal(session.outputs, outputs)
        session.step(1.0)
        assert np.array_equal(session.outputs, after)


def test_a_state_continues_bitwise_in_another_process(any_fmu, tmp_path):
    saved = tmp_path / "state.bin"
    with Session(any_fmu, {"target.angularRate0": [0.01, 0.05, 0.02]}) as session:
        run(session)
        saved.write_bytes(bytes(session.state()))
        expected = run(session)
    program = (
        "import sys; sys.path[:0] = sys.argv[3:]\n"
        "from pathlib import Path\n"
        "from baryscope.fmu import Session\n"
        "from test_state import run\n"
        "with Session(sys.argv[1]) as session:\n"
        "    session.restore(Path(sys.argv[2]).read_bytes())\n"
        "    print(run(session))"
    )
    folders = [*sys.path, str(Path(__file__).parent)]
    arguments = [sys.executable, "-c", program, str(any_fmu), str(saved), *folders]
    result = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == str(expected)


def test_a_state_can_be_restored_in_another_session(any_fmu):
    with Session(any_fmu) as one, Session(any_fmu, start_time=50.0) as other:
        one.step(3.0, torque=[1.0, 0.0, 0.0])
        state = one.state()
        other.restore(state)
        one.step(3.0)
        other.step(3.0)
        assert np.array_equal(one.outputs, other.outputs)
        assert one.time == other.time


def test_states_are_freed_with_their_session(any_fmu):
    with Session(any_fmu) as session:
        state = session.state()
        state.close()
        state.close()
        with pytest.raises(InputError, match="closed"):
            session.restore(state)
        left = session.state()
    for call in (left.to_bytes, lambda: Session(any_fmu).restore(left)):
        with pytest.raises(InputError, match="closed"):
            call()
    with pytest.raises(InputError, match="the session was closed"):
        session.step(1.0)


@pytest.mark.parametrize("place", [0, 9, 20, 26, 60, -1])
def test_damaged_bytes_are_refused_and_change_nothing(any_fmu, place):
    with Session(any_fmu) as session:
        session.step(1.0)
        content = bytearray(session.state().to_bytes())
        session.step(1.0)
        before = session.outputs.copy()
        content[place] ^= 1
        for bad in (bytes(content), bytes(content[:-1]), b"", b"barysess"):
            with pytest.raises((InputError, UnitError)):
                session.restore(bad)
        assert session.time == 2.0
        assert np.array_equal(session.outputs, before)
        session.step(1.0)


def test_a_state_of_another_form_is_refused(envisat_fmu, any_fmu3):
    with Session(envisat_fmu) as two, Session(any_fmu3) as three:
        for state in (two.state(), bytes(two.state())):
            with pytest.raises(UnitError, match="another build"):
                three.restore(state)


def test_tuning_moves_the_features_at_once(any_fmu, envisat):
    points = np.array([point.position for point in envisat.features.points])
    with Session(any_fmu) as session:
        session.step(10.0)
        arms = session.features - session.position
        session.tune({"target.features": 2 * points})
        np.testing.assert_allclose(session.features - session.position, 2 * arms, rtol=1e-12)


@pytest.mark.parametrize("parameters, error, words", [
    ({"orbit.raan": 1.0}, InputError, "orbit.raan: is fixed after the start, expected one of target.features"),
    ({"features": 1.0}, InputError, "features: not a parameter"),
    ({"solver.tolerance": 0.0}, UnitError, "solver.tolerance"),
    ({"target.features": np.zeros((2, 3))}, InputError, "found shape"),
])  # fmt: skip
def test_wrong_tuning_is_refused_and_changes_nothing(any_fmu, parameters, error, words):
    with Session(any_fmu) as session:
        session.step(1.0)
        before = session.outputs.copy()
        with pytest.raises(error, match=words):
            session.tune(parameters)
        assert np.array_equal(session.outputs, before)
        session.step(1.0)


def test_refused_inputs_are_forgotten(any_fmu):
    with Session(any_fmu) as session, Session(any_fmu) as clean:
        with pytest.raises(UnitError, match="nan"):
            session.step(1.0, torque=[np.nan, 0.0, 0.0])
        with pytest.raises(InputError, match="shape"):
            session.step(1.0, acceleration=[1.0, 0.0, 0.0], torque=[1.0])
        session.step(1.0, torque=[0.0, 1.0, 0.0])
        clean.step(1.0, torque=[0.0, 1.0, 0.0])
        assert np.array_equal(session.outputs, clean.outputs)
