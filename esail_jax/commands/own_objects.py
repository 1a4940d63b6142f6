"""The options `--voltage-law FILE.py:NAME` and `--terms FILE.py:NAME`: what a user wrote, read from a
Python file."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from esail_jax.commands.options import UsageError
from esail_jax.errors import InputError


def read_law(text: str) -> Any:
    """The law called NAME in a Python file, given as FILE.py:NAME. NAME is a law, or a class or function
    without arguments that gives one. Raises UsageError."""
    return read_object("--voltage-law", "a law", text, is_law)


def read_terms(texts: list[str]) -> list[Any]:
    """The terms called NAME in Python files, each given as FILE.py:NAME. NAME is a term, a list of terms,
    or a class or function without arguments that gives either. Raises UsageError."""
    found = [read_object("--terms", "a term, or a list of terms", text, is_terms) for text in texts]
    return [term for one in found for term in (one if isinstance(one, list | tuple) else [one])]


def is_law(found: Any) -> bool:
    """Tells whether an object is a law, and not what gives one."""
    return not isinstance(found, type) and (hasattr(found, "commanded") or hasattr(found, "update"))


def is_terms(found: Any) -> bool:
    """Tells whether an object is a term or a list, and not what gives one."""
    return isinstance(found, list | tuple) or not callable(found)


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
        found = getattr(module, name)
        return found if is_made(found) else found()
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise UsageError(f"`{option}` must name {what}, but {text} raises {reason}") from error
