"""Standard streams that lack characters, or are not there."""

import json
import os
import subprocess
import sys

import pytest

BARYSCOPE = [sys.executable, "-m", "baryscope"]
WITHOUT_UTF8 = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize("variables", [{"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "cp1252"}, WITHOUT_UTF8])
def test_characters_that_standard_output_lacks(variables):
    """They are replaced for people, and escaped in JSON."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONIOENCODING"} | variables
    text, data = (
        subprocess.run([*BARYSCOPE, "scenarios", *more], env=environment, capture_output=True, check=False)
        for more in ([], ["--json"])
    )
    for done in (text, data):
        assert done.returncode == 0
        assert done.stderr == b""
    assert b"envisat" in text.stdout
    assert b"?/s" in text.stdout or "°/s".encode("cp1252") in text.stdout
    assert any("°/s" in preset["description"] for preset in json.loads(data.stdout))


def test_what_the_user_wants_of_such_characters():
    environment = os.environ | {"PYTHONIOENCODING": "ascii:backslashreplace"}
    done = subprocess.run([*BARYSCOPE, "scenarios"], env=environment, capture_output=True, check=False)
    assert b"\\xb0/s" in done.stdout
