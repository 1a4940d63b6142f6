"""How runs in motion are shown: the options that `esail animate` and `esail view` share, applied to what
run files hold."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from esail_jax.commands.options import UsageError
from esail_jax.viewing.motion import Motion
from esail_jax.viewing.motions import read_motions


def motions_of(paths: Sequence[Path], options: argparse.Namespace, most: int) -> list[Motion]:
    """Returns the moving pictures of the files. most: largest number of saved instants in one picture.

    Raises RunFileError, and UsageError for a colour or axes that they do not have."""
    found = read_motions(paths, tuple(options.members), most)
    if len({motion.turning for motion in found}) > 1:
        raise UsageError("`RUN.h5` must be files of sails or of chains, but there are both")
    known = [*dict.fromkeys(name for motion in found for name in motion.colours), "none"]
    if options.colour is not None and options.colour not in known:
        raise UsageError(f"`--colour` must be one of {', '.join(known)} here, but is {options.colour!r}")
    if options.axes is not None and not found[0].turning:
        raise UsageError(f"`--axes` must be left out with a chain, but is {options.axes!r}")
    return found
