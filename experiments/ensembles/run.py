"""Runs the parts of this study one after the other.

    python experiments/ensembles/run.py                             # the four measurements, half an hour
    python experiments/ensembles/run.py equality scaling            # only these
    python experiments/ensembles/run.py monte_carlo --folder DIR    # ten thousand sails, 305 MB in DIR

throughput:  members per second of one core; throughput.csv
roofline:    limits of members in lockstep; roofline.csv
equality:    members compared with single runs; equality.csv
scaling:     members per second of all cores; scaling.csv
monte_carlo: ten thousand uncertain sails; DIR/ensemble.h5 and figures
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent

MEASUREMENTS = ("throughput", "roofline", "equality", "scaling")
"""Parts that run by default, in this order."""

ON_ONE_CORE = ("throughput", "roofline")
"""Parts whose process is bound to one core."""


def bind_to_one_core() -> None:
    """Binds the calling process to the first of its cores, where the system supports this."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def run_part(part: str, folder: Path | None) -> None:
    """Runs one part in a process of its own. Raises CalledProcessError if the part fails."""
    print(f"== {part}", flush=True)
    if part == "monte_carlo":
        command = ["sh", str(HERE / "monte_carlo.sh"), str(folder)]
    else:
        command = [sys.executable, str(HERE / f"{part}.py")]
    subprocess.run(command, check=True, preexec_fn=bind_to_one_core if part in ON_ONE_CORE else None)


def main() -> None:
    """Runs the chosen parts, all measurements if none is named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parts = (*MEASUREMENTS, "monte_carlo")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"any of {', '.join(parts)}")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where monte_carlo writes its results")
    options = parser.parse_args()
    for part in options.parts:
        if part not in parts:
            parser.error(f"PART must be one of {', '.join(parts)}, but is {part!r}")
    if "monte_carlo" in options.parts and options.folder is None:
        parser.error("monte_carlo needs --folder DIR")
    for part in options.parts or MEASUREMENTS:
        run_part(part, options.folder)


if __name__ == "__main__":
    main()
