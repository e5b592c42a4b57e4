"""What `baryscope fly` warns of: a camera that looks away at the start, and thrust that nobody tells the estimator."""

import warnings

from baryscope.study.loop import fly_loop
from systems import rewritten


def bound(name, value):
    """A change of the controller's parameter."""
    return rf'(?s)(name="controller".*?Parameter name="{name}">\s*<ssv:Real value=")[^"]*', rf"\g<1>{value}"


def said(system):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        loop = fly_loop(system, duration=20.0)
    return loop, [str(one.message) for one in caught]


def test_a_system_as_it_is_written_has_no_warning(system):
    loop, words = said(system)
    assert words == []
    assert loop.tracks.seen[2:].all()


def test_the_camera_finds_the_target_wherever_it_is_to_hold(system, tmp_path):
    """With hold.position across the target it looked the other way, and nothing was ever seen, without a word."""
    loop, words = said(rewritten(system, tmp_path / "other.ssp", bound(r"hold\.position\[2\]", "15.0")))
    assert words == []
    assert loop.tracks.seen[2:].all()


def test_a_camera_that_looks_away_is_warned_of(system, tmp_path):
    loop, words = said(rewritten(system, tmp_path / "away.ssp", bound(r"chaser\.position0\[2\]", "15.0")))
    assert not loop.tracks.seen.any()
    assert words == [
        "at the start no feature can be in view: the camera looks 180° past the target; it looks as from "
        "chaser.position0 of controller, [0.0, 15.0, 0.0] m, but the chaser starts at [0.0, -20.0, 0.0] m"
    ]


def test_images_have_edges(system, tmp_path):
    """The target is 24° off; images of 400 pixels at a focal length of 1911, in a rig that has no edges, end before."""
    edges = [
        (rf'(?s)(Parameter name="camera\.resolution\[{k}\]">\s*<ssv:Real value=")[^"]*', r"\g<1>400.0") for k in (1, 2)
    ]
    start = bound(r"chaser\.position0\[1\]", "9.0")
    assert said(rewritten(system, tmp_path / "wide.ssp", start))[1] == []
    _, words = said(rewritten(system, tmp_path / "narrow.ssp", start, *edges))
    assert len(words) == 1
    assert "the camera looks 24° past the target" in words[0]


def test_thrust_that_nobody_tells_the_estimator_is_warned_of(system, tmp_path):
    """The status is tracking, with errors of thousands of claims, and the chaser ends anywhere."""
    cut = r'<ssd:Connection [^>]*endElement="estimator" endConnector="chaser\.acceleration\[\d\]"[^>]*/>', ""
    _, words = said(rewritten(system, tmp_path / "cut.ssp", cut))
    assert words == [
        "estimator.chaser.acceleration[1] is not connected, expected controller.command.acceleration[1] or what "
        "commands the chaser: thrust of which the estimator is not told makes its estimates and claims wrong"
    ]
