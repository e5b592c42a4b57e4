"""documentation/index.html and the icon: in their places, complete, and the same in every build."""

import xml.etree.ElementTree as ET
import zipfile
from html.parser import HTMLParser

import pytest

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.documentation import documents
from baryscope.fmu.units import UNITS, blueprint_of
from baryscope.fmu.units.target import target_blueprint
from baryscope.models.variables import variable_table

VOID = {"meta", "img"}


def page_of(scenario, fmi):
    return documents(target_blueprint(scenario), fmi)["documentation/index.html"].decode()


class Page(HTMLParser):
    """Texts of the cells of tables, links and images; checks that every element is closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.rows, self.links, self.text = [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.links += [value for name, value in attrs if name in ("href", "src")]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.mark.parametrize(
    "fixture, icon", [("envisat_fmu", "model.png"), ("envisat_fmu3", "terminalsAndIcons/icon.png")]
)
def test_they_are_where_the_standards_look_for_them(request, fixture, icon):
    """FMI 2.0.4, 2.3 and FMI 3.0.2, 2.5.1: entry point of the documentation, entry point of the licences, icon."""
    with zipfile.ZipFile(request.getfixturevalue(fixture)) as archive:
        page, picture = archive.read("documentation/index.html").decode(), archive.read(icon)
        names = set(archive.namelist())
    assert "documentation/licenses/license.txt" in names
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = (int.from_bytes(picture[at : at + 4], "big") for at in (16, 20))
    assert width == height == 128
    # The page's links lead to members of the archive.
    links = Page(page).links
    assert len(links) == 2
    for link in links:
        assert (link.removeprefix("../") if link.startswith("../") else f"documentation/{link}") in names


@pytest.mark.parametrize("name", ["envisat", "pushed"])
def test_every_variable_and_every_feature_is_in_the_page(request, name):
    scenario = request.getfixturevalue(name)
    page = Page(page_of(scenario, 3))
    cells = {row[0]: row for row in page.rows if len(row) == 7}
    for variable in variable_table(len(scenario.features.points), scenario.forces):
        row = cells[f"{variable.name}{list(variable.shape) if variable.shape else ''}"]
        assert row[2] == ("Boolean" if variable.boolean else variable.unit)
        assert row[6].startswith(variable.description)
    assert [row[1] for row in page.rows if len(row) == 4][1:] == list(scenario.features.labels)
    assert ("drag of an exponential atmosphere" in page.text) == (name == "pushed")


@pytest.mark.parametrize("unit", UNITS)
def test_rows_and_columns_of_arrays_are_named(envisat, unit):
    """Once for each unit, and only for those that have rows of features.

    The pages of rig and estimator had no label; that of the controller, which has no rows, said `12; their number is
    built in`. In which order `covariances` has its columns stood in the descriptions of scalars alone.
    """
    blueprint = blueprint_of(unit, envisat)
    page = Page(documents(blueprint, 3)["documentation/index.html"].decode())
    labels = envisat.features.labels
    assert [page.text.count(label) for label in labels] == [0 if unit == "controller" else 1] * len(labels)
    assert ("their number is built in" in page.text) == (unit != "controller")
    cells = {row[0]: row[6] for row in page.rows if len(row) == 7}
    description = ET.fromstring(describe_unit(blueprint, 3)[0])  # noqa: S314  our own
    described = {v.get("name"): v.get("description") for v in description.find("ModelVariables")}
    assert ("covariances[12, 6]" in cells) == (unit in ("rig", "estimator"))
    columns = {"covariances[12, 6]": "xx; xy; xz; yy; yz; zz", "pixels[12, 3]": "u, left; v; u, right"}
    for name in columns.keys() & cells.keys():
        assert cells[name].endswith(f": {columns[name]}")
        assert described[name.partition("[")[0]].endswith(f": {columns[name]}; rows: {', '.join(labels)}")


def test_starts_are_shown_in_the_units_that_people_read(envisat):
    rows = {row[0]: row for row in Page(page_of(envisat, 2)).rows if len(row) == 7}
    assert rows["orbit.semiMajorAxis"][3:6] == ["km", "7150 km", "≥ 0"]
    assert rows["orbit.inclination"][4] == "98.55 deg"
    assert rows["target.angularRate0[3]"][4] == "3.38, 0.45, 0.77 deg/s"
    assert rows["orbit.eccentricity"][5] == "0 to below 1"
    assert rows["solver.tolerance"][5] == "1e-15 to 0.001"


def test_what_it_says_of_inputs_is_what_the_description_declares(envisat):
    """Only FMI 2 has derivatives of inputs."""
    for fmi in (2, 3):
        declared = b'canInterpolateInputs="true"' in describe_unit(target_blueprint(envisat), fmi)[0]
        assert ("first derivatives that the importer sets" in page_of(envisat, fmi)) == declared
        assert declared == (fmi == 2)


def test_texts_of_a_scenario_are_escaped(envisat):
    text = page_of(envisat.model_copy(update={"description": "<script>&"}), 2)
    assert "envisat: &lt;script&gt;&amp;" in text
    assert "<script>" not in text
