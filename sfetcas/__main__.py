"""``python -m sfetcas``."""

import sys

from .cli import main

sys.exit(main())
