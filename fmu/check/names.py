"""Names of variables under the naming convention "structured", by its grammar (FMI 2.0.4, section 2.2.9).

fmpy's validation has the grammar, too, and parses each name with it; one name takes as long as all by this expression.
"""

import re
from collections.abc import Iterator
from typing import Any

from baryscope.fmu.check.finding import Finding, error

_LETTERS = r"[A-Za-z_][A-Za-z0-9_]*"
_QUOTED = r"""'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_PART = rf"(?:{_LETTERS}|{_QUOTED})(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
_NAME = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)")


def is_structured(description: Any) -> bool:
    """Whether the description says that its names follow the convention."""
    return bool(description.variableNamingConvention == "structured")


def is_structured_name(name: str) -> bool:
    """Whether the convention has such a name: parts with indices, between dots, perhaps a derivative."""
    return _NAME.fullmatch(name) is not None


def name_findings(description: Any) -> Iterator[Finding]:
    """Names that the description's convention, if it is "structured", does not have."""
    if not is_structured(description):
        return
    for variable in description.modelVariables:
        if not is_structured_name(variable.name):
            yield error(variable.name, 'found this name, expected one of the naming convention "structured"')
