"""The option `--voltage-law FILE.py:NAME`: a voltage law that a user wrote, read from a Python file."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

from esail_jax.commands.options import UsageError
from esail_jax.errors import InputError


def read_law(text: str) -> Any:
    """The law called NAME in a Python file, given as FILE.py:NAME.

    NAME is a law, or a class or function without arguments that gives one. The module is called by the
    file's name, so that a run file names the same law each time. Raises UsageError."""
    file, colon, name = text.rpartition(":")
    path = Path(file)
    if not colon or path.suffix != ".py" or not name:
        raise UsageError(f"`--voltage-law` must look like FILE.py:NAME, but is {text!r}")
    if not path.is_file():
        raise UsageError(f"`--voltage-law` must name an existing file, but there is no {path}")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
        found = getattr(module, name)
        is_law = not isinstance(found, type) and (hasattr(found, "commanded") or hasattr(found, "update"))
        return found if is_law else found()
    except InputError:
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise UsageError(f"`--voltage-law` must name a law, but {text} raises {reason}") from error
