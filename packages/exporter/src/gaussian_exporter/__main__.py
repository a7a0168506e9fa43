"""`python -m gaussian_exporter`: the command `gaussian-export`."""

import sys

from .cli import main

sys.exit(main())
