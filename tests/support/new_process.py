"""Code in a new Python process, for tests of what is imported."""

import os
import subprocess
import sys

HEAVY = {"jax", "scipy", "diffrax", "equinox", "matplotlib"}
"""Libraries that take longer to import than a command without computation may last."""


def output_of(code: str, **environment: str) -> str:
    """What the code prints in a process without the variables that `esail_jax` sets."""
    clean = {
        name: value for name, value in os.environ.items() if name not in ("JAX_ENABLE_X64", "XLA_FLAGS")
    }
    command = [sys.executable, "-c", code]
    found = subprocess.run(command, env=clean | environment, capture_output=True, text=True, check=True)
    return found.stdout


def heavy_imports_of(arguments: list[str]) -> tuple[int, list[str]]:
    """The exit code of a command line and the heavy libraries that it imports."""
    code = f"""
import sys
from esail_jax.cli import main
try:
    status = main({arguments})
except SystemExit as stop:
    status = stop.code
print(int(status or 0), *sorted({HEAVY} & set(sys.modules)))
"""
    status, *found = output_of(code).splitlines()[-1].split()
    return int(status), found
