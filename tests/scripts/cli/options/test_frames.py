"""What the command line tells of the orbit beside its file."""

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.scripts.cli import app
from baryscope.scripts.cli.options.frames import FrameChoices

ORBIT = """[orbit]
semi_major_axis = 7.15e6
eccentricity = 0.001
inclination_deg = 98.5
accuracy = 2000.0
"""


@pytest.fixture
def orbit(tmp_path):
    path = tmp_path / "orbit.toml"
    path.write_text(ORBIT)
    return path


@pytest.mark.parametrize(("told", "expected"), [(None, 2000.0), (0.0, 0.0), (300.0, 300.0)])
def test_the_command_line_tells_how_exact_an_orbit_is_rather_than_its_file(orbit, told, expected):
    tracks = FeatureTracks(np.arange(3.0), np.ones((3, 1, 3)), ["a"])
    assert FrameChoices(orbit=orbit, orbit_accuracy=told).read(tracks).orbit.accuracy == expected


def test_an_accuracy_without_bounds_is_none(orbit):
    tracks = FeatureTracks(np.arange(3.0), np.ones((3, 1, 3)), ["a"])
    with pytest.raises(InputError, match=r"--orbit-accuracy: .*found -1 m, expected 0 to 715000 m"):
        FrameChoices(orbit=orbit, orbit_accuracy=-1.0).read(tracks)


def test_it_needs_an_orbit(capsys, tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("time,feature,x,y,z\n0,a,1,2,3\n")
    assert app.main(["estimate", str(path), "--orbit-accuracy", "10"]) == 2
    assert (
        capsys.readouterr()
        .err.splitlines()[-1]
        .endswith("--orbit-accuracy: needs the target's orbit, expected --orbit ORBIT")
    )
