"""Units with one error each: changes of modelDescription.xml, and the finding that each must give."""

import re
import xml.etree.ElementTree as ET
import zipfile

import pytest

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.compiler import DEFINITIONS, Job, compile_all, find_compiler
from baryscope.fmu.generate.sources import MAIN, SCENARIO, interface_headers
from baryscope.fmu.layout.platforms import host_platform

EQUATIONS, MUTANT = "model.c", "mutant.c"
DEFINED = "".join(f"#define {word[2:].replace('=', ' ')}\n" for word in DEFINITIONS).encode()
EXPORTED = b"#include <math.h>\n#define casadi_real double\n#define casadi_int int\n"


def rewritten(source, target, change):
    """A copy of an FMU with `change(name, content)` in the place of each member; None leaves it out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = change(name, old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def mutated(source, target, mutate):
    """A copy of an FMU with a changed modelDescription.xml."""

    def change(name, content):
        if name != "modelDescription.xml":
            return content
        root = ET.fromstring(content)  # noqa: S314 - our own
        mutate(root)
        return ET.tostring(root, encoding="UTF-8", xml_declaration=True)

    return rewritten(source, target, change)


def relinked(source, target, blueprint, fmi, changes):
    """A copy of an FMU whose library is of changed sources: the file, what stands in it once, what takes its place.

    It is compiled without optimisation, for the few seconds that such a unit flies; its equations, which no change is
    in and which take most of the time, once for all units that share them.
    """
    _, sources = describe_unit(blueprint, fmi)
    sources = dict(sources) | interface_headers(fmi)
    for file, old, new in changes:
        assert sources[file].count(old) == 1, file
        sources[file] = sources[file].replace(old, new)
    headers = {name: content for name, content in sources.items() if name.endswith(".h") or name == SCENARIO}
    both = {EQUATIONS: sources[EQUATIONS], MUTANT: DEFINED + without_equations(sources, MAIN)}
    job = Job(headers | both, EQUATIONS, "library.so", host_platform(), tuple(find_compiler()), MUTANT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        [library] = compile_all([job]).values()
    return rewritten(source, target, lambda name, content: library if name.startswith("binaries/") else content)


def without_equations(sources, name):
    """A source with those that it includes in their places, but of the equations their declarations alone, and without
    what another version of FMI includes.
    """
    if name == EQUATIONS:
        functions = re.findall(rb"^CASADI_SYMBOL_EXPORT (.*\)) ?{", sources[name], re.MULTILINE)
        return EXPORTED + b"".join(function + b";\n" for function in functions)
    parts = re.split(rb'^#include "(\w+\.c)"$', sources[name], flags=re.MULTILINE)
    parts[1::2] = (
        without_equations(sources, part.decode()) if part.decode() in sources else b"" for part in parts[1::2]
    )
    return b"".join(parts)


# ---- what can be wrong in FMI 2 ----


def variable(root, name):
    return root.find(f"ModelVariables/ScalarVariable[@name='{name}']")


def place(root, name):
    return str([v.get("name") for v in root.find("ModelVariables")].index(name) + 1)


def unknown(root, element, name):
    return root.find(f"ModelStructure/{element}/Unknown[@index='{place(root, name)}']")


def wrong_token(root):
    root.set("guid", root.get("guid")[:-2] + "0}" if root.get("guid")[-2] != "0" else root.get("guid")[:-2] + "1}")


def missing_start(root):
    del variable(root, "target.inertia.xx").find("Real").attrib["start"]


def start_with_another_last_digit(root):
    real = variable(root, "orbit.semiMajorAxis").find("Real")
    digits = real.get("start").replace(".0", "") + ".000000001"
    real.set("start", digits)


def wrong_boolean_start(root):
    variable(root, "gravityGradient").find("Boolean").set("start", "true")


def wrong_unit_of_an_output(root):
    variable(root, "features[2,1]").find("Real").set("unit", "m/s")


def wrong_unit_of_a_state(root):
    real = variable(root, "state.trueAnomaly").find("Real")
    real.set("unit", "m")
    del real.attrib["displayUnit"]


def wrong_base_units(root):
    root.find("UnitDefinitions/Unit[@name='m/s2']/BaseUnit").set("s", "-1")


def wrong_factor(root):
    root.find("UnitDefinitions/Unit[@name='rad']/BaseUnit").set("factor", "0.0174532925199433")


def undefined_unit(root):
    definitions = root.find("UnitDefinitions")
    definitions.remove(definitions.find("Unit[@name='J']"))


def drop_dependency(element, of, on):
    def mutate(root):
        entry = unknown(root, element, of)
        left = [index for index in entry.get("dependencies").split() if index != place(root, on)]
        assert len(left) < len(entry.get("dependencies").split())
        entry.set("dependencies", " ".join(left))

    return mutate


def dependency_on_another(root):
    """A dependency on velocity in the place of one on position."""
    entry = unknown(root, "Outputs", "chaser.position[1]")
    assert entry.get("dependencies") == place(root, "state.position[1]")
    entry.set("dependencies", place(root, "state.velocity[1]"))


def dependency_on_a_parameter(root):
    unknown(root, "Outputs", "chaser.position[1]").set("dependencies", place(root, "orbit.raan"))


def flag(interface, name, value):
    def mutate(root):
        root.find(interface).set(name, value)

    return mutate


def removed_unknown(element, name):
    def mutate(root):
        root.find(f"ModelStructure/{element}").remove(unknown(root, element, name))

    return mutate


def swap_references(one, other):
    def mutate(root):
        pair = [variable(root, one), variable(root, other)]
        numbers = [v.get("valueReference") for v in pair]
        for v, number in zip(pair, reversed(numbers), strict=True):
            v.set("valueReference", number)

    return mutate


def shared_reference(root):
    same = variable(root, "orbit.inclination").get("valueReference")
    variable(root, "orbit.raan").set("valueReference", same)


def reference_to_nowhere(root):
    variable(root, "target.position[1]").set("valueReference", "9999")


def renamed(root):
    variable(root, "target.rotationalEnergy").set("name", "target.kineticEnergy")


def parameter_for_input(root):
    v = variable(root, "chaser.acceleration[2]")
    v.set("causality", "parameter")
    v.set("variability", "tunable")


def tunable_for_fixed(root):
    variable(root, "orbit.raan").set("variability", "tunable")


def local_for_output(root):
    variable(root, "orbit.trueAnomaly").set("causality", "local")


def derivative_of_another_state(root):
    variable(root, "der(state.position[1])").find("Real").set("derivative", place(root, "state.position[2]"))


def derivative_of_nothing(root):
    variable(root, "der(state.position[1])").find("Real").set("derivative", "9999")


def undefined_display_unit(root):
    variable(root, "orbit.semiMajorAxis").find("Real").set("displayUnit", "Mm")


def another_display_unit(root):
    del variable(root, "orbit.inclination").find("Real").attrib["displayUnit"]


def wrong_display_factor(root):
    root.find("UnitDefinitions/Unit[@name='rad']/DisplayUnit").set("factor", "0.0174532925199433")


def start_outside_its_limits(root):
    variable(root, "orbit.eccentricity").find("Real").set("min", "0.5")


def other_limits(root):
    variable(root, "solver.tolerance").find("Real").set("max", "1.0")


def unknown_log_category(root):
    ET.SubElement(root.find("LogCategories"), "Category", name="logDynamicStateSelection")


def end_before_the_start(root):
    root.find("DefaultExperiment").set("stopTime", "-5.0")


def nominal_of_nothing(root):
    variable(root, "state.position[2]").find("Real").set("nominal", "0.0")


def too_many_event_indicators(root):
    root.set("numberOfEventIndicators", "2")


# Mutation, what an error of ours must say, whether fmpy's validation alone has something to say.
MUTATIONS_2 = [
    (end_before_the_start, "DefaultExperiment/stopTime: found -5, expected a time after that of the start, 0", False),
    (nominal_of_nothing, r"state.position\[2\]: found nominal 0.0, expected a positive number", False),
    (too_many_event_indicators, "numberOfEventIndicators: found 2, but .* expected 0", False),
    (wrong_token, "the token is not this library's", False),
    (missing_start, "target.inertia.xx.*has no start value", True),
    (start_with_another_last_digit, "orbit.semiMajorAxis: found start 7", False),
    (wrong_boolean_start, "gravityGradient: found start 0.0 in the binary, expected 1.0", False),
    (wrong_unit_of_an_output, r'features\[2,1\]: found unit "m/s", expected "m"', False),
    (wrong_unit_of_a_state, r'der\(state.trueAnomaly\): found unit "rad/s"', False),
    (wrong_base_units, 'unit "m/s2": found exponents m=1, s=-1, expected m=1, s=-2', False),
    (wrong_factor, 'unit "rad": found factor 0.017', False),
    (undefined_unit, 'The unit "J" .* is not defined', True),
    (drop_dependency("Outputs", "features[1,1]", "state.position[1]"), r"features\[1,1\]: depends on state", False),
    (drop_dependency("Derivatives", "der(state.velocity[1])", "chaser.acceleration[1]"), "depends on chaser", False),
    (drop_dependency("InitialUnknowns", "target.rotationalEnergy", "target.inertia.xy"), "depends on target.i", False),
    (drop_dependency("InitialUnknowns", "der(state.angularRate[1])", "gravityGradient"), "depends on gravity", False),
    (dependency_on_another, r"chaser.position\[1\]: depends on state.position\[1\]", False),
    (dependency_on_a_parameter, r"chaser.position\[1\]: depends on state.position\[1\]", False),
    (flag("CoSimulation", "maxOutputDerivativeOrder", "3"), "maxOutputDerivativeOrder: .*order 2, expected 1", False),
    (flag("ModelExchange", "canGetAndSetFMUstate", "false"), "canSerializeFMUstate: is declared without", False),
    (removed_unknown("InitialUnknowns", "features[1,1]"), "InitialUnknowns does not contain", True),
    (removed_unknown("Outputs", "target.position[2]"), "Outputs must have exactly one entry", True),
    (removed_unknown("Derivatives", "der(state.velocity[3])"), r"der\(state.velocity\[3\]\): is the derivative", True),
    (swap_references("orbit.inclination", "orbit.raan"), "orbit.raan: found start", False),
    (swap_references("features[1,1]", "features[2,1]"), r"features\[2,1\]: found .* by the equations", False),
    (swap_references("state.position[1]", "state.position[2]"), "as in the vector of states", False),
    (shared_reference, "orbit.raan: found value reference .* which orbit.inclination has already", False),
    (reference_to_nowhere, r"target.position\[1\]: cannot be read .* value reference 9999", False),
    (renamed, "target.rotationalEnergy: is missing", False),
    (parameter_for_input, r"chaser.acceleration\[2\]: is a tunable parameter", False),
    (tunable_for_fixed, "orbit.raan: is declared as a tunable parameter, but in a run", False),
    (local_for_output, "orbit.trueAnomaly: is a continuous local", True),
    (derivative_of_another_state, r"found derivative of state.position\[2\], expected of", True),
    (derivative_of_nothing, "cannot be understood", True),
    (undefined_display_unit, 'display unit "Mm" .* is not defined', True),
    (another_display_unit, 'orbit.inclination: found displayUnit "None", expected "deg"', False),
    (wrong_display_factor, 'display unit "deg": found factor 0.017.*, expected 57.29', False),
    (start_outside_its_limits, "orbit.eccentricity: found start 0.001, expected 0.5 to 1", False),
    (other_limits, "solver.tolerance: found limits 1e-15 to 1, expected 1e-15 to 0.001", False),
    (unknown_log_category, "LogCategories/logDynamicStateSelection: is declared, but", False),
]


# ---- what can be wrong in FMI 3, with arrays ----


def variable3(root, name):
    return next(v for v in root.find("ModelVariables") if v.get("name") == name)


def unknown3(root, element, name):
    reference = variable3(root, name).get("valueReference")
    return root.find(f"ModelStructure/{element}[@valueReference='{reference}']")


def wrong_token3(root):
    root.set("instantiationToken", "{00000000-0000-0000-0000-000000000000}")


def short_array_start(root):
    start = variable3(root, "target.attitude0").get("start").split()
    variable3(root, "target.attitude0").set("start", " ".join(start[:-1]))


def one_start_for_an_array(root):
    variable3(root, "target.attitude0").set("start", "0.5")


def missing_start3(root):
    del variable3(root, "target.attitude0").attrib["start"]


def changed_element(root):
    start = variable3(root, "target.features").get("start").split()
    start[7] = repr(float(start[7]) * (1 + 4e-16))
    variable3(root, "target.features").set("start", " ".join(start))


def wrong_dimension(root):
    variable3(root, "target.angularRate").find("Dimension").set("start", "4")


def wrong_unit3(root):
    variable3(root, "features").set("unit", "m/s")


def dropped3(element, of, on):
    def mutate(root):
        entry, reference = unknown3(root, element, of), variable3(root, on).get("valueReference")
        declared = entry.get("dependencies").split()
        assert reference in declared
        entry.set("dependencies", " ".join(known for known in declared if known != reference))

    return mutate


def removed3(element, name):
    def mutate(root):
        root.find("ModelStructure").remove(unknown3(root, element, name))

    return mutate


def wrong_derivative3(root):
    variable3(root, "der(state.position)").set("derivative", variable3(root, "state.velocity").get("valueReference"))


def shared_reference3(root):
    variable3(root, "orbit.raan").set("valueReference", variable3(root, "orbit.inclination").get("valueReference"))


def swapped_references3(root):
    pair = [variable3(root, name) for name in ("target.position", "target.velocity")]
    numbers = [v.get("valueReference") for v in pair]
    for v, number in zip(pair, reversed(numbers), strict=True):
        v.set("valueReference", number)


MUTATIONS_3 = [
    (wrong_token3, "the token is not this library's", False),
    (short_array_start, "target.attitude0: found 3 start values, expected 4", False),
    (one_start_for_an_array, "target.attitude0: found start", False),
    (missing_start3, "target.attitude0.*has no start value", True),
    (changed_element, "target.features: found start", False),
    (wrong_dimension, "target.angularRate: found 4 elements, expected 3", False),
    (wrong_unit3, 'features: found unit "m/s", expected "m"', False),
    (dropped3("Output", "features", "state.position"), "features: depends on state.position", False),
    (dropped3("Output", "features", "target.features"), "features: depends on target.features", False),
    (dropped3("Output", "normals", "target.normals"), "normals: depends on target.normals", False),
    (
        dropped3("ContinuousStateDerivative", "der(state.angularRate)", "gravityGradient"),
        r"der\(state.angularRate\): depends on gravityGradient",
        False,
    ),
    (removed3("InitialUnknown", "features"), "InitialUnknowns does not contain", True),
    (removed3("Output", "target.position"), "Outputs must have exactly one entry", True),
    (wrong_derivative3, "is one of 2 derivatives of state.velocity", True),
    (shared_reference3, "refers to a variable that does not exist", True),
    (swapped_references3, r"target.position\[1\]: found .* by the equations", False),
    (flag("CoSimulation", "maxOutputDerivativeOrder", "3"), "maxOutputDerivativeOrder: .*order 2, expected 1", False),
]
