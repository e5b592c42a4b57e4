"""The page where the units run, in Chromium: motion and estimate are those by fmpy, and sliders change them."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.geometry.symmetric import FULL
from baryscope.fmu import Session
from baryscope.fmu.system import build_system, open_system
from baryscope.live import write_live_page
from baryscope.live.page import own_file
from baryscope.models.scenario import load_scenario, preset_names
from baryscope.models.variables import AXES
from baryscope.report.charts import expected_error
from browser import PROGRAM, Browser

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)")

AGREEMENT = 1e-9  # relative: WebAssembly has its own sine and cosine
STEPS = 120
PRESET, CHASER = 0, 1  # lists of the run
UNLIKELY = 1e-6
MISSED = "Share of missed observations"
MOMENT = "Principal moment of inertia near {}"
UNTIL_IT_MOVES = (
    "new Promise((done) => { const look = () => (baryscope.time > 0 ? done() : setTimeout(look, 20)); look(); })"
)
INK = "document.querySelector('canvas').toDataURL()"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write_live_page(tmp_path_factory.mktemp("live") / "index.html")


@pytest.fixture(scope="module")
def browser(file):
    """A browser whose page may say nothing at all."""
    browser = Browser(file.parent / "profile", width=1300, height=1000)
    yield browser
    said = [event for event in browser.events if event["method"] == "Runtime.consoleAPICalled"]
    complaints = browser.complaints
    browser.close()
    assert (said, complaints) == ([], [])


@pytest.fixture
def page(browser, file):
    """The page as it is at first, for a reader who likes it still: it waits for steps."""
    if not browser.value("Boolean(window.baryscope) && matchMedia('(prefers-reduced-motion: reduce)').matches"):
        assert browser.complaints == []
        browser.open(file, still=True)
    pick(browser, CHASER, 0)
    pick(browser, PRESET, preset_names().index("envisat"))
    return browser


def pick(page, which, index):
    page.value(
        f"(() => {{ const one = document.querySelectorAll('[aria-label=Run] select')[{which}]; "
        f"one.selectedIndex = {index}; one.dispatchEvent(new Event('change')); }})()"
    )


def slider(name):
    return f"[...document.querySelectorAll('input')].find((one) => one.ariaLabel === {json.dumps(name)})"


def slide(page, name, value):
    """Drag a slider of that name to a value of its own, which the browser keeps within its ends."""
    page.value(
        f"(() => {{ const one = {slider(name)}; one.value = {value}; one.dispatchEvent(new Event('input')); }})()"
    )


def step(page, count):
    page.value(f"baryscope.step({count})")


def of(page, element, name):
    return np.array(page.value(f"baryscope.units.{element}.get({json.dumps(name)})"))


def text_of(page, selector):
    return page.value(f"document.querySelector({selector!r}).textContent")


def chi_square(page):
    """That of the estimated centre of mass, of 3 degrees of freedom, and what the estimator claims, m."""
    error = of(page, "estimator", "target.position") - of(page, "plant", "target.position")
    covariance = of(page, "estimator", "target.positionCovariance")[FULL].reshape(3, 3)
    return error @ np.linalg.solve(covariance, error), np.sqrt(np.trace(covariance))


def tensor(page):
    xx, yy, zz, xy, xz, yz = (of(page, "plant", f"target.inertia.{axes}")[0] for axes in AXES)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_it_is_one_file_of_which_all_has_a_name(page, file):
    assert file.stat().st_size < 1e6
    assert page.nameless == 0
    assert page.heading_levels == [1, 2, 2, 2, 2]
    assert page.value("[...document.querySelectorAll('svg[role=img], canvas')].every((one) => one.ariaLabel)")
    assert page.value("[...document.querySelectorAll('input[type=range]')].every((one) => one.ariaValueText)")
    assert page.value("baryscope.time") == 0
    assert not page.value("document.querySelector('[role=status]').textContent").startswith("Refused")


def test_the_loop_is_that_of_the_fmus(page, envisat, tmp_path):
    """Of the four units as FMUs, stepped by fmpy. Rounding shows in the filter, but far below its noise."""
    step(page, STEPS)
    with open_system(build_system(envisat, tmp_path / "chain.ssp")) as master:
        for _ in range(STEPS):
            master.step()
        claimed = np.sqrt(master.units["estimator"].vector("target.positionCovariance")[[0, 3, 5]]).min()
        for element, name, tolerance in (
            ("plant", "target.attitude", AGREEMENT),
            ("plant", "target.position", 1e-4 * claimed),
            ("rig", "seen", 0.0),
            ("rig", "points", 1e-4 * claimed),
            ("estimator", "target.position", 1e-4 * claimed),
            ("estimator", "target.positionCovariance", 1e-4 * claimed**2),
            ("estimator", "status", 0.0),
        ):
            expected = master.units[element].vector(name)
            np.testing.assert_allclose(of(page, element, name), expected, rtol=0, atol=tolerance, err_msg=name)
        assert expected == [2.0]


def test_sliders_change_the_body_and_the_orbit_and_the_motion_follows(page, envisat, envisat_fmu):
    """The chaser drifts freely: nothing but the unit moves it. The same parameters in Python give the same motion."""
    before = tensor(page)
    pick(page, CHASER, 2)
    slide(page, MOMENT.format("z"), np.log(100e3))
    slide(page, "Angular rate about y", 5.0)
    slide(page, "Semi-major axis", np.log(9000.0))
    slide(page, "Eccentricity", 0.2)
    after = tensor(page)
    # The same principal axes, and two of the moments: the larger of the others leaves no less than their difference.
    np.testing.assert_allclose(before @ after, after @ before, rtol=0, atol=AGREEMENT * np.trace(before) ** 2)
    small, large = np.linalg.eigvalsh(before)[:2]
    np.testing.assert_allclose(np.linalg.eigvalsh(after), sorted([small, large, large - small]), rtol=1e-5)
    step(page, STEPS)
    names = ("target.angularRate0", "orbit.semiMajorAxis", "orbit.eccentricity")
    parameters = {name: of(page, "plant", name) for name in names}
    np.testing.assert_allclose(parameters["target.angularRate0"], np.deg2rad([3.38, 5.0, 0.77]), rtol=1e-12)
    assert parameters["orbit.semiMajorAxis"] == pytest.approx(9e6)
    assert parameters["orbit.eccentricity"] == pytest.approx(0.2)
    for element in ("estimator", "controller"):
        assert of(page, element, "orbit.eccentricity") == parameters["orbit.eccentricity"]
    moments = {f"target.inertia.{axes}": of(page, "plant", f"target.inertia.{axes}")[0] for axes in AXES}
    given = envisat.parameters() | {k: v if v.size > 1 else v[0] for k, v in parameters.items()} | moments
    with Session(envisat_fmu, given) as session:
        for _ in range(STEPS):
            session.step(1.0)
        for name in ("target.attitude", "target.position", "features", "orbit.trueAnomaly"):
            found, expected = of(page, "plant", name), np.ravel(session[name])
            np.testing.assert_allclose(found, expected, rtol=AGREEMENT, atol=AGREEMENT, err_msg=name)
    with Session(envisat_fmu) as session:
        for _ in range(STEPS):
            session.step(1.0)
        assert np.abs(of(page, "plant", "target.attitude") - session["target.attitude"]).max() > 0.1


@pytest.mark.parametrize("end", [-1e9, 1e9])
def test_no_slider_leads_to_what_cannot_be(page, end):
    """Wherever they are dragged, there is a body and an orbit, and the units take them."""
    for name in page.value("[...document.querySelectorAll('fieldset input')].map((one) => one.ariaLabel)"):
        slide(page, name, end)
        step(page, 2)
        assert not text_of(page, "[role=status]").startswith("Refused"), name
        moments = np.linalg.eigvalsh(tensor(page))
        assert moments[0] > 0
        assert moments[2] < moments[0] + moments[1]
    rate = np.linalg.norm(of(page, "plant", "target.angularRate0"))
    assert rate == pytest.approx(np.deg2rad(20) * np.sqrt(3), rel=1e-3)


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_flown_and_its_centre_found_as_well_as_claimed(page, name):
    """Tracking, the tumble known, and an error that its covariance explains: one in a million draws would not."""
    scenario = load_scenario(name)
    pick(page, PRESET, preset_names().index(name))
    step(page, 600)
    count = len(scenario.features.points)
    assert f" of {count} features seen" in text_of(page, ".reading")
    R = Rotation.from_quat(of(page, "plant", "target.attitude"), scalar_first=True)
    arms = of(page, "plant", "features").reshape(-1, 3)[:count] - of(page, "plant", "target.position")
    np.testing.assert_allclose(arms, R.apply([one.position for one in scenario.features.points]), atol=1e-9)
    assert text_of(page, "[role=status]").startswith("tracking, tumble known")
    square, claimed = chi_square(page)
    size = np.linalg.norm(arms, axis=1).max()
    assert claimed < size / 100
    assert square < chi2.isf(UNLIKELY, 3)
    assert page.value("document.querySelectorAll('svg path.curve').length") == 1
    assert page.value("document.querySelectorAll('svg .mark').length") == 2
    assert f"±{shown(claimed)}" in text_of(page, ".reading")


def shown(metres):
    """A length as the page has it, in four digits."""
    unit, factor = ("µm", 1e6) if metres < 1e-3 else ("mm", 1e3) if metres < 0.1 else ("m", 1)
    return f"{float(f'{metres * factor:.4g}'):g} {unit}"


def test_bands_and_moments_are_those_of_python(page):
    """Quantiles are read from a table: between its rows they are off by less than a line is wide."""
    source, data = own_file("run.js"), "JSON.parse(document.getElementById('data').textContent).band"
    roots = np.random.default_rng(2).normal(size=(20, 3, 3)) * [1.0, 0.3, 0.05]
    covariances = roots @ roots.transpose(0, 2, 1)
    upper = covariances[:, *np.triu_indices(3)]
    found = page.value(f"(() => {{ {source}; return {upper.tolist()}.map((C) => expectedError(C, {data})) }})()")
    low, high = expected_error(covariances)
    np.testing.assert_allclose([one[1] for one in found], high, rtol=1e-4)
    np.testing.assert_allclose([one[0] for one in found], low, atol=1e-3 * np.sqrt(np.trace(covariances[0])))
    for (xx, xy, xz, yy, yz, zz), C in zip(upper.tolist(), covariances, strict=True):
        moments = page.value(f"(() => {{ {source}; return eigenvalues({[xx, yy, zz, xy, xz, yz]}) }})()")
        np.testing.assert_allclose(moments, np.linalg.eigvalsh(C), atol=1e-7 * np.trace(C))


def test_cameras_change_while_it_runs(page):
    step(page, 60)
    slide(page, "Noise of a pixel coordinate", 5.0)
    slide(page, MISSED, 50.0)
    assert page.value("baryscope.time") == 60
    before = np.trace(of(page, "rig", "covariances")[FULL].reshape(3, 3))
    seen = []
    for _ in range(20):
        step(page, 1)
        seen.append(of(page, "rig", "seen").mean())
    found = of(page, "rig", "covariances").reshape(-1, 6)[of(page, "rig", "seen") > 0][0]
    assert before > 0
    assert 50 < np.trace(found[FULL].reshape(3, 3)) / before < 200  # ten times the noise
    assert 0.3 < np.mean(seen) < 0.7


def test_the_approach_begins_when_the_tumble_is_known(page):
    pick(page, CHASER, 1)
    step(page, 90)
    assert np.linalg.norm(of(page, "plant", "chaser.position")) == pytest.approx(20, abs=0.1)
    step(page, 210)
    assert of(page, "controller", "goal.synchronised") == 1
    assert np.linalg.norm(of(page, "plant", "chaser.position")) < 15


def test_play_moves_on_and_stops_and_keys_do_too(page):
    ink = page.value(INK)
    page.click("button.play")
    page.value(UNTIL_IT_MOVES)
    page.value("document.querySelector('canvas').focus()")
    page.key(" ", 32, " ")
    time = page.value("baryscope.time")
    assert time > 0
    assert page.value(INK) != ink
    page.value("new Promise((done) => setTimeout(done, 100))")
    assert page.value("baryscope.time") == time
    assert "ms for a step" in text_of(page, ".timing")
    value = of(page, "plant", "target.inertia.xx")
    page.value(f"{slider(MOMENT.format('x'))}.focus()")
    page.key("ArrowRight", 39)
    assert of(page, "plant", "target.inertia.xx") > value
    assert page.value("baryscope.time") == 0


def test_it_begins_by_itself_unless_the_reader_likes_it_still(browser, file):
    browser.open(file)
    browser.value(UNTIL_IT_MOVES)
    assert text_of(browser, "button.play") == "‖ pause"


def test_what_a_unit_refuses_is_told(page):
    """A share of 2, from a slider that goes too far."""
    step(page, 2)
    page.value(f"{slider(MISSED)}.max = 200")
    slide(page, MISSED, 200)
    told = text_of(page, "[role=status]")
    assert told.startswith("Refused.")
    assert "dropout" in told
    slide(page, MISSED, 10)
    page.click("button.again")
    step(page, 2)
    assert not text_of(page, "[role=status]").startswith("Refused")


def test_other_noise_is_other_noise_of_the_same_motion(page):
    step(page, 10)
    points, features = of(page, "rig", "points"), of(page, "plant", "features")
    page.value("[...document.querySelectorAll('button')].find((one) => one.textContent === 'other noise').click()")
    step(page, 10)
    assert np.abs(of(page, "rig", "points") - points).max() > 1e-3
    np.testing.assert_allclose(of(page, "plant", "features"), features, atol=1e-6)
