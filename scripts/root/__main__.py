"""`python -m baryscope` is the command `baryscope`."""

import sys

from baryscope.scripts.cli.app import main

sys.exit(main())
