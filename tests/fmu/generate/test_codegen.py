"""The generated C: how it grows with the number of features, of which a scanned target has hundreds."""

import re

import numpy as np
import pytest

from baryscope.fmu import Session, build_fmu
from baryscope.fmu.generate.codegen import generated_sources
from baryscope.fmu.units import blueprint_of
from baryscope.models.scenario.tables import FeaturePoint


def scanned(scenario, count):
    """The scenario with so many features, at random."""
    rng = np.random.default_rng(1)
    normals = rng.standard_normal((count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = [
        FeaturePoint(label=f"P{k}", position=tuple(place), normal=tuple(normal))
        for k, (place, normal) in enumerate(zip(3 * normals + rng.uniform(-1, 1, (count, 3)), normals, strict=True))
    ]
    return scenario.model_copy(update={"features": scenario.features.model_copy(update={"points": points})})


def statements(scenario, count):
    """Number of lines of each function of the target's equations, by its CasADi signature's name."""
    source = generated_sources(blueprint_of("target", scanned(scenario, count)))["model.c"]
    parts = re.split(r"^/\* (target_\w+):.*$", source, flags=re.MULTILINE)
    return {name: body.count(";") for name, body in zip(parts[1::2], parts[2::2], strict=True)}


def test_only_the_checks_of_the_features_grow_with_their_number(envisat):
    few, many = statements(envisat, 4), statements(envisat, 40)
    grown = {name for name in few if many[name] > few[name]}
    assert grown == {"target_margins", "target_found"}


def test_no_number_has_a_branch_of_its_own(envisat):
    """Compilers take twice as long for them; no caller passes a null pointer."""
    source = generated_sources(blueprint_of("target", scanned(envisat, 4)))["model.c"]
    assert "arg[0][" in source
    assert not re.search(r"arg\[\d+\]\s*\?|res\[\d+\]\s*!=", source)


@pytest.mark.parametrize("fmi", [2, 3])
def test_three_hundred_features_are_where_the_body_has_them(envisat, tmp_path, fmi):
    scenario = scanned(envisat, 300)
    with Session(build_fmu(scenario, tmp_path / "scanned.fmu", fmi=fmi)) as session:
        for _ in range(3):
            session.step(7.0)
        w, *v = session["target.attitude"]
        x, y, z = v
        R = np.eye(3) + 2 * w * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        R += 2 * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        body = np.array([point.position for point in scenario.features.points])
        outward = np.array([point.normal for point in scenario.features.points])
        np.testing.assert_allclose(session.features, session["target.position"] + body @ R.T, atol=1e-12)
        np.testing.assert_allclose(session.normals, outward @ R.T, atol=1e-14)
