"""``python -m splitnerf`` is the command ``splitnerf``."""

import sys

from splitnerf.cli import main

sys.exit(main())
