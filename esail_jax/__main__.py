"""`python -m esail_jax` is the command `esail`."""

import sys

from esail_jax.cli import main

sys.exit(main())
