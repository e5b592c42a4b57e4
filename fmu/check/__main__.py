"""`python -m baryscope.fmu.check FOLDER RESULTS`: the checks that run a binary, in a process of their own."""

import sys
from pathlib import Path

from baryscope.fmu.check.binary import main

main(Path(sys.argv[1]), Path(sys.argv[2]))
