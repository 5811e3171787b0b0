"""``python -m splitnerf.train DATA [OPTIONS]``: the same as ``splitnerf train``."""

import sys

from splitnerf.cli import main

if __name__ == "__main__":
    sys.exit(main(["train", *sys.argv[1:]]))
