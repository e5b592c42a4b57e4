"""`python -m baryscope.fmu.check FOLDER RESULTS`: runs the checks of a binary in this process."""

import sys
from pathlib import Path

from baryscope.fmu.check.binary import main

main(Path(sys.argv[1]), Path(sys.argv[2]))
