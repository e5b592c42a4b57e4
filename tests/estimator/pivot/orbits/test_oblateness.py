"""Whether the Earth's J2 acts on an orbit that is given without it."""

from baryscope.estimator.findings import UntoldOblateness
from baryscope.estimator.methods import estimate
from baryscope.study.population.judging import of_estimate, prepared, wrong


def test_drag_does_not_pass_for_j2():
    """On an orbit without J2, ten minutes of blackout between the first frames and those with attitudes: J2, which the
    tracks seemed to show, left process noise and took a share of the drag, with a NEES of 20.6 at the first frame.
    """
    case, sample, _ = prepared(70, 10, "third")
    found = estimate(sample.tracks, orbit=case.orbit)
    assert not [one for one in found.findings if isinstance(one, UntoldOblateness) and one.certain]
    assert not wrong(of_estimate(found, case.path))
