"""What may be set when, in Model Exchange."""

import numpy as np
import pytest


def test_parameters_can_be_set_to_what_they_are_in_every_state(model):
    m, reference = model.fmu, model.references
    fixed, tunable, flag = (reference[n] for n in ("orbit.raan", "target.features[1,1]", "gravityGradient"))
    model.initialise()
    m.newDiscreteStates()
    m.enterContinuousTimeMode()
    m.setReal([fixed, tunable], m.getReal([fixed, tunable]))
    m.setBoolean([flag], m.getBoolean([flag]))
    model.refused(lambda: m.setReal([fixed], [0.1]), "orbit.raan", "fixed")
    model.refused(lambda: m.setReal([tunable], [0.1]), "target.features[1,1]", "Event Mode only")
    model.refused(lambda: m.setBoolean([flag], [1]), "gravityGradient", "Event Mode only")


def test_guesses_of_states_make_no_difference(model):
    """Their starts are `approx`: the parameters tell them."""
    m, attitude = model.fmu, [model.references[f"state.attitude[{k}]"] for k in (1, 2, 3, 4)]
    m.setReal(attitude, [0.0] * 4)
    model.initialise()
    outputs = m.getReal([model.references[f"target.attitude[{k}]"] for k in (1, 2, 3, 4)])
    assert m.getReal(attitude) == outputs
    assert np.linalg.norm(outputs) == pytest.approx(1.0, rel=1e-15)
