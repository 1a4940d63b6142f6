"""Options of a command line: the values that they stand for, and the error for those that are wrong."""

import argparse
import math
import tomllib
from pathlib import Path
from typing import Any

from esail_jax.errors import InputError

MOVIES = (".webp", ".gif", ".mp4")
"""Endings of the files that `esail animate` writes."""

PAGES = (".html", ".htm")
"""Endings of the files that `esail view` writes."""

TABLES = (".csv", ".nc")
"""Endings of the files that `esail export` writes."""

SIDES = range(64, 4097)
"""Widths and heights [pixel] that `esail animate` draws."""


class UsageError(InputError):
    """A command line that cannot be understood."""


def settings(options: argparse.Namespace) -> dict[str, Any]:
    """Overrides from `--set` and `--t-end`, by scene key."""
    found = {}
    for text in options.settings:
        key, equals, value = text.partition("=")
        if not equals or "." not in key:
            raise UsageError(f"`--set` must look like table.key=VALUE, but is {text!r}")
        found[key.strip()] = toml_or_text(value)
    if options.t_end is not None:
        found["integrator.t_end"] = toml_or_text(options.t_end)
    return found


def toml_or_text(text: str) -> Any:
    """The value of a TOML text, or the text itself if it is no TOML."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if list(parsed) == ["value"] else text.strip()


def objective_weights(options: argparse.Namespace) -> dict[str, float]:
    """Weights from `--objective`, by objective. Raises UsageError."""
    found = {}
    for text in options.weights:
        name, equals, weight = text.partition("=")
        value = toml_or_text(weight)
        if not equals or isinstance(value, bool) or not isinstance(value, (int, float)):
            raise UsageError(f"`--objective` must look like NAME=WEIGHT, but is {text!r}")
        found[name.strip()] = float(value)
    return found


def observable_names(options: argparse.Namespace) -> list[str] | None:
    """Names from `--observables`; None for all."""
    if options.observables is None:
        return None
    return [name.strip() for name in options.observables.split(",")]


def check_run(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail run` that are missing or do not fit together."""
    if options.output is None and not options.estimate:
        raise UsageError("`-o RUN.h5` must be given (or `--estimate`), but is missing")
    for name in ("output", "resume", "stability"):
        if options.estimate and getattr(options, name):
            given = "-o" if name == "output" else f"--{name}"
            raise UsageError(f"`{given}` must be left out with --estimate, but is given")


def check_design(options: argparse.Namespace) -> None:
    """Raises UsageError for numbers of `esail design` that are out of range."""
    for name in ("iterations", "starts"):
        if getattr(options, name) < 1:
            raise UsageError(f"`--{name}` must be positive, but is {getattr(options, name)}")


def check_looks(options: argparse.Namespace) -> None:
    """Raises UsageError for an exaggeration that is not positive and finite, and for an output that exists
    already."""
    check_positive(options, "exaggeration")
    refuse_existing(options.output, options.overwrite)


def check_export(options: argparse.Namespace) -> None:
    """Raises UsageError for an output of another format than those of `esail export`, and for one that
    exists already."""
    suffix = options.output.suffix.lower()
    if suffix not in TABLES:
        raise UsageError(f"`-o` must end in {' or '.join(TABLES)}, but ends in {suffix!r}")
    refuse_existing(options.output, options.overwrite)


def check_view(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail view` that are out of range, and for an output that exists
    already."""
    suffix = options.output.suffix.lower()
    if suffix not in PAGES:
        raise UsageError(f"`-o` must end in {' or '.join(PAGES)}, but ends in {suffix!r}")
    check_looks(options)


def check_animate(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail animate` that are out of range, and for an output that exists
    already. Replaces `size` by width and height [pixel]."""
    suffix = options.output.suffix.lower()
    if suffix not in MOVIES:
        raise UsageError(
            f"`-o` must end in {', '.join(MOVIES[:-1])} or {MOVIES[-1]}, but ends in {suffix!r}"
        )
    for name in ("fps", "seconds"):
        check_positive(options, name)
    if len(options.members) > 1:
        raise UsageError(f"`--member` must be given once, but is {len(options.members)} times")
    sides = options.size.lower().split("x")
    if len(sides) != 2 or not all(side.isdecimal() and int(side) in SIDES for side in sides):
        allowed = f"{SIDES[0]} to {SIDES[-1]}"
        raise UsageError(f"`--size` must be WIDTHxHEIGHT, each {allowed}, but is {options.size!r}")
    options.size = tuple(map(int, sides))
    check_looks(options)


def check_positive(options: argparse.Namespace, name: str) -> None:
    """Raises UsageError for an option that is given but not positive and finite."""
    value = getattr(options, name)
    if value is not None and not 0.0 < value < math.inf:
        raise UsageError(f"`--{name}` must be positive and finite, but is {value:g}")


def refuse_existing(path: Path, overwrite: bool | None = None) -> None:
    """Raises UsageError if a file exists already, unless `overwrite`. None: the command has no such
    option."""
    if path.exists() and not overwrite:
        hint = " (or ask for --overwrite)" if overwrite is not None else ""
        raise UsageError(f"`{path}` must not exist{hint}, but does")


def check_modes(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail modes` that are out of range, or a result that would
    be overwritten."""
    if options.count is not None and options.count < 1:
        raise UsageError(f"`--count` must be positive, but is {options.count}")
    if options.json is not None and options.json.exists() and options.json.stat().st_size:
        raise UsageError(f"`--json` must be a new or an empty file, but {options.json} has content")


def check_ensemble(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail ensemble` that are out of range or do not fit together."""
    for name, least in (
        ("members", 1), ("seed", 0), ("max-steps", 1), ("processes", 1), ("process", 0),
    ):  # fmt: skip
        value = getattr(options, name.replace("-", "_"))
        if value is not None and value < least:
            must = "be positive" if least else "not be negative"
            raise UsageError(f"`--{name}` must {must}, but is {value}")
    given = [getattr(options, name) is not None for name in ("coordinator", "process")]
    if any(given) and not options.distributed:
        raise UsageError("`--coordinator` and `--process` must come with --distributed, but do not")
    if any(given) and not (all(given) and options.processes is not None):
        raise UsageError("`--coordinator` must come with --process and --processes, but does not")
    if options.distributed and not any(given) and options.processes is not None:
        raise UsageError(
            "`--processes` must be left to the cluster, or come with --coordinator, but is given"
        )
