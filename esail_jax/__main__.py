"""`python -m esail_jax` is the command `esail`."""

import sys

from esail_jax.cli import main

if __name__ == "__main__":  # the ranks of an MPI job import this module, too
    sys.exit(main())
