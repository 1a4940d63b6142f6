"""What the commands of `esail` have in common: parser, exit codes, the scene of a command with its options,
and the error for a command line that is wrong."""

import argparse
import enum
import importlib.util
import math
import sys
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from esail_jax.errors import InputError

if TYPE_CHECKING:
    from esail_jax.scenes.scene import Scene


class ExitCode(enum.IntEnum):
    """How a command ended."""

    DONE = 0
    BAD_INPUT = 2
    """The input was refused: one line on stderr, nothing written."""
    FAILED = 3
    """The solver failed; the file holds everything before the failure."""
    CLOSED_PIPE = 141
    """The reader of the output has ended, as in `esail scenes | head`: the code of a shell for SIGPIPE."""
    INTERRUPTED = 130
    """Ctrl-C or SIGTERM; `--resume` continues."""


class UsageError(InputError):
    """A command line that cannot be understood."""


OPTIONS = {
    "axes": "--axes",
    "calendar": "--calendar",
    "colour": "--colour",
    "every": "--every",
    "exaggeration": "--exaggeration",
    "first": "--from",
    "folder": "-o",
    "fps": "--fps",
    "last": "--to",
    "member": "--member",
    "members": "--members",
    "mission": "--mission",
    "object_name": "--object",
    "observables": "--observables",
    "output": "-o",
    "path": "-o",
    "reduce": "--reduce",
    "run": "RUN.h5",
    "runs": "RUN.h5",
    "seconds": "--seconds",
    "seed": "--seed",
    "size": "--size",
    "task": "--resume",
    "time_system": "--time-system",
    "vary": "--vary",
}
"""The options that stand for arguments of Python functions, whose names errors give as their `key`."""


def in_options(error: InputError) -> str:
    """The message of an error, which begins with an option if the error is about its argument: `--vary` in
    place of `vary`."""
    argument = getattr(error, "key", "").partition(" ")[0]
    option = OPTIONS.get(argument, argument)
    return str(error).replace(f"`{argument}", f"`{option}", 1)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    given: Sequence[str] = ()

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parses arguments, None for those of the process."""
        self.given = sys.argv[1:] if args is None else args
        return super().parse_args(args, namespace)

    def error(self, message: str):
        blanks = setting_with_blanks(self.given)
        if message.startswith("unrecognized arguments") and blanks:
            raise UsageError(f"`--set` must be table.key=VALUE without blanks around `=`, but is {blanks}")
        raise UsageError(f"{self.prog}: {message} (`{self.prog} --help` shows what there is)")


def setting_with_blanks(given: Sequence[str]) -> str:
    """The first setting of a command line that has blanks around its `=`, otherwise an empty
    text."""
    for k, word in enumerate(given):
        setting, following = [*given[k + 1 : k + 2], ""][0], given[k + 2 : k + 4]
        if word != "--set" or not following:
            continue
        if "=" not in setting and following[0].startswith("="):
            return " ".join([setting, *following[: 2 if following[0] == "=" else 1]])
        if setting.endswith("=") and not following[0].startswith("-"):
            return f"{setting} {following[0]}"
    return ""


class ShowVersion(argparse.Action):
    """The action of `--version`, which reads the version only where it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib import metadata

        print(f"esail_jax {metadata.version('esail_jax')}")
        parser.exit()


def add_command(commands: Any, name: str, text: str) -> argparse.ArgumentParser:
    """A parser of one command. text: its help."""
    return commands.add_parser(
        name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False
    )


def add_scene(command: argparse.ArgumentParser) -> None:
    """Adds the arguments of every command that simulates a given scene."""
    command.add_argument("scene", help="name of a built-in scene, or path of a TOML file")
    command.add_argument("--t-end", metavar="SECONDS", help="end time [s] instead of the scene's")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="table.key=VALUE",
        dest="settings",
        help="value of a scene key instead of the scene's, in TOML; may be given several times",
    )


# ---- the scene of a command --------------------------------------------------------------------


def scene_of(options: argparse.Namespace) -> "Scene":
    """Reads and checks the scene of a command, before JAX is imported: an error is reported at once, and so
    is a number that may be in a wrong unit."""
    from esail_jax.scenes.loading import load_scene
    from esail_jax.scenes.own_terms import OWN_TERMS
    from esail_jax.scenes.plausibility import doubts, without_effect
    from esail_jax.scenes.voltage import OWN_LAW, MissingLaw

    overrides = settings(options)
    if getattr(options, "voltage_law", None) is not None:
        overrides[OWN_LAW] = read_law(options.voltage_law)
    if getattr(options, "terms", None):
        overrides[OWN_TERMS] = read_terms(options.terms)
    try:
        scene = load_scene(options.scene, overrides)
    except MissingLaw as error:
        raise missing_law(options) from error
    if not getattr(options, "quiet", False):
        for sentence in (*doubts(scene), *without_effect(scene)):
            print(sentence, file=sys.stderr)
    return scene


def missing_law(options: argparse.Namespace) -> UsageError:
    """The error for a scene of a user's law without the law: it names the option that gives it, if
    the command has one."""
    if hasattr(options, "voltage_law"):
        return UsageError(
            '`--voltage-law FILE.py:NAME` must be given with `voltage.law` = "python", but is missing'
        )
    return UsageError(
        f"`voltage.law` must be a law of the package for `esail {options.command}`, which takes no "
        '`--voltage-law`, but is "python"'
    )


def settings(options: argparse.Namespace) -> dict[str, Any]:
    """Overrides from `--set` and `--t-end`, by scene key."""
    overrides = {}
    for text in options.settings:
        key, equals, value = text.partition("=")
        if not equals or "." not in key:
            raise UsageError(f"`--set` must look like table.key=VALUE, but is {text!r}")
        overrides[key.strip()] = toml_or_text(value)
    if options.t_end is not None:
        overrides["integrator.t_end"] = toml_or_text(options.t_end)
    return overrides


def toml_or_text(text: str) -> Any:
    """The value of a TOML text, or the text itself if it is no TOML."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if list(parsed) == ["value"] else text.strip()


def read_law(text: str) -> Any:
    """The law called NAME in a Python file, given as FILE.py:NAME. NAME is a law, or a class or function
    without arguments that gives one. Raises UsageError."""
    return read_object("--voltage-law", "a law", text, is_law)


def read_terms(texts: list[str]) -> list[Any]:
    """The terms called NAME in Python files, each given as FILE.py:NAME. NAME is a term, a list of terms,
    or a class or function without arguments that gives either. Raises UsageError."""
    objects = [read_object("--terms", "a term, or a list of terms", text, is_terms) for text in texts]
    return [term for one in objects for term in (one if isinstance(one, list | tuple) else [one])]


def is_law(value: Any) -> bool:
    """Tells whether an object is a law, and not what gives one."""
    return not isinstance(value, type) and (hasattr(value, "commanded") or hasattr(value, "update"))


def is_terms(value: Any) -> bool:
    """Tells whether an object is a term or a list, and not what gives one."""
    return isinstance(value, list | tuple) or not callable(value)


def read_object(option: str, what: str, text: str, is_made: Callable[[Any], bool]) -> Any:
    """An object in a Python file, given as FILE.py:NAME. is_made: tells whether it is what is meant, and
    not a class or function that gives it.

    The module is called by the file's name, so that a run file names the same object each time. Raises
    UsageError."""
    file, colon, name = text.rpartition(":")
    path = Path(file)
    if not colon or path.suffix != ".py" or not name:
        raise UsageError(f"`{option}` must look like FILE.py:NAME, but is {text!r}")
    if not path.is_file():
        raise UsageError(f"`{option}` must name an existing file, but there is no {path}")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
        value = getattr(module, name)
        return value if is_made(value) else value()
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise UsageError(f"`{option}` must name {what}, but {text} raises {reason}") from error


# ---- checks of options -------------------------------------------------------------------------


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


def pairs(option: str, texts: list[str]) -> dict[str, str]:
    """The parts before and behind the equals sign of every text. Raises UsageError."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            form = "OBSERVABLE=SD" if option == "--noise" else "KEY=normal:MEAN:SD"
            raise UsageError(f"`{option}` must look like {form}, but is {text!r}")
        if name.strip() in found:
            raise UsageError(f"`{option}` must be given once for {name.strip()}, but is twice")
        found[name.strip()] = value.strip()
    return found


def noise_of(options: argparse.Namespace) -> dict[str, float]:
    """The standard deviations of `--noise`, by observable. Raises UsageError."""
    return {
        name: number_of("--noise", name, text) for name, text in pairs("--noise", options.noise).items()
    }


def number_of(option: str, name: str, text: str) -> float:
    """A number of an option. Raises UsageError."""
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"`{option} {name}` must be a number, but is {text!r}") from None
