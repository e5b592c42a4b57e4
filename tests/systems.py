"""Systems whose structure is changed, for tests."""

import re
import zipfile

from baryscope.fmu.system.structure import STRUCTURE


def rewritten(system, path, *changes):
    """A copy with changes of the structure: a pattern, and what comes in its place."""
    with zipfile.ZipFile(system) as archive, zipfile.ZipFile(path, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            if name == STRUCTURE:
                for pattern, new in changes:
                    content, count = re.subn(pattern.encode(), new.encode(), content)
                    assert count
            copy.writestr(name, content)
    return path
