"""What an .ssp says of values beside numbers, by SSP 1.0: files, levels, prefixes and units. Followed or refused."""

import zipfile

import pytest

from baryscope.fmu.system import build_system, open_system
from baryscope.models.errors import InputError
from systems import rewritten

SPACES = "http://ssp-standard.org/SSP1/SystemStructure"
SET = (
    f'<ssv:ParameterSet xmlns:ssv="{SPACES}ParameterValues" xmlns:ssc="{SPACES}Common" version="1.0" name="own">'
    "<ssv:Parameters>%s</ssv:Parameters><ssv:Units>"
    '<ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000" /></ssc:Unit>'
    '<ssc:Unit name="kg"><ssc:BaseUnit kg="1" /></ssc:Unit></ssv:Units></ssv:ParameterSet>'
)
AXIS = "orbit.semiMajorAxis"
FILE = '<ssd:ParameterBinding %ssource="resources/own.ssv" />'


@pytest.fixture(scope="module")
def system(envisat, tmp_path_factory):
    return build_system(envisat, tmp_path_factory.mktemp("system") / "chain.ssp")


def real(name, value, unit=""):
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{unit} /></ssv:Parameter>'


def with_file(system, path, parameters, *changes):
    """A copy with changes and a file of parameters."""
    rewritten(system, path, *changes)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/own.ssv", SET % parameters)
    return path


def at_the_plant(binding, *, last=True):
    """A change that adds a binding after or before the plant's own."""
    if last:
        return r"(plant-parameters(?:.|\n)*?)(</ssd:ParameterBindings>)", rf"\g<1>{binding}\g<2>"
    return r"(<ssd:ParameterBindings>)(\s*<ssd:ParameterBinding>\s*<ssd:ParameterValues>\s*<[^>]*plant-p)", (
        rf"\g<1>{binding}\g<2>"
    )


def at_the_system(binding):
    bindings = f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"
    return '<ssd:System name="loop">', f'<ssd:System name="loop">{bindings}'


START = 7_150_000.0  # m, of the scenario
FOLLOWED = {
    "a file at a component, last": (real(AXIS, 7.1e6), at_the_plant(FILE % ""), 7.1e6),
    "a file at a component, first": (real(AXIS, 7.1e6), at_the_plant(FILE % "", last=False), START),
    "a file at the system": (real(f"plant.{AXIS}", 7.1e6), at_the_system(FILE % ""), 7.1e6),
    "a prefix": (real("semiMajorAxis", 7.1e6), at_the_plant(FILE % 'prefix="orbit." '), 7.1e6),
    "a prefix at the system": (real(AXIS, 7.1e6), at_the_system(FILE % 'prefix="plant." '), 7.1e6),
    "another unit": (real(AXIS, 7100, ' unit="km"'), at_the_plant(FILE % ""), 7.1e6),
    "the same unit, not defined": (real(AXIS, 7.1e6, ' unit="m"'), at_the_plant(FILE % ""), 7.1e6),
}


@pytest.mark.parametrize("case", FOLLOWED)
def test_parameters_are_those_that_hold(case, system, tmp_path):
    """The system's bindings were passed over, units of values too, so that 7100 km were 7100 m."""
    parameters, change, expected = FOLLOWED[case]
    with open_system(with_file(system, tmp_path / "own.ssp", parameters, change)) as master:
        assert master.units["plant"].vector(AXIS).tolist() == [expected]


MAPPED = FILE.replace(" />", "><ssd:ParameterMapping /></ssd:ParameterBinding>")
IN_KM = (r'(name="features\[1,1\]" kind="output">\s*<ssc:Real) />', r'\1 unit="km" />')
REFUSED = {
    "a mapping": ([at_the_plant(MAPPED % "")], "binding of plant maps its parameters"),
    "a file in a component": ([at_the_plant(FILE % 'sourceBase="component" ')], "expected a file in the archive"),
    "another kind of unit": ([at_the_plant(FILE % "")], f'binds plant.{AXIS} in "kg", expected "m"'),
    "no element of the system": ([at_the_system(FILE % "")], f"binds {AXIS} at the system, expected the name"),
    "connectors of different units": (
        [IN_KM],
        r'connects plant.features\[1,1\] in "km" to rig.features\[1,1\] in "m", expected one unit',
    ),
    "two outputs to one input": (
        [(r'endConnector="chaser\.acceleration\[2\]"', 'endConnector="chaser.acceleration[1]"')],
        r"connects two outputs to plant.chaser.acceleration\[1\], expected one",
    ),
    "another start": ([('startTime="0"', 'startTime="100"')], "starts at 100 s, expected 0 s"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_would_change_values_unseen_is_refused(case, system, tmp_path):
    changes, message = REFUSED[case]
    bad = with_file(system, tmp_path / "bad.ssp", real(AXIS, 7.1e6, ' unit="kg"'), *changes)
    with pytest.raises(InputError, match=message), open_system(bad):
        pass


def test_connectors_of_different_units_may_be_meant(system, tmp_path):
    """By suppressUnitConversion, or by one unit of two names."""
    meant = (r'(endElement="rig" endConnector="features\[1,1\]")', r'\1 suppressUnitConversion="true"')
    named = (
        r"(<ssd:DefaultExperiment)",
        r'<ssd:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" /></ssc:Unit></ssd:Units>\1',
    )
    for change in (meant, named):
        with open_system(rewritten(system, tmp_path / "meant.ssp", IN_KM, change)) as master:
            master.step()
