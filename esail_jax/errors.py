"""The errors that users meet. This module imports no library: the command line needs it before JAX."""

import difflib
import errno
import re
from collections.abc import Iterable
from typing import Any


class InputError(ValueError):
    """Input that cannot be used as given: a scene (`SceneError`), a run file (`RunFileError`), or a command
    line. The message is one line."""


class SceneError(InputError):
    """A scene, a law or a term of a user that cannot be used; the message names the key, what it must be
    and what it is."""

    def __init__(self, key: str, must: str, got: str):
        super().__init__(one_line(f"`{key}` must {must}, but {got}"))
        self.key, self.must, self.got = key, must, got

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.key, self.must, self.got)


def one_line(text: str) -> str:
    """The text with characters that cannot be printed, such as line breaks, as escape sequences."""
    return "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)


class NoSpaceError(OSError):
    """A file that could not be written because the disk, or the user's share of it, is full."""


def sentence_of(error: OSError) -> str:
    """The system's error about a file or a folder, in the grammar of all messages."""
    if error.filename is None or error.strerror is None:
        return str(error)
    return f"`{error.filename}` must be accessible, but is not: {error.strerror}"


FULL = (errno.ENOSPC, errno.EDQUOT)
"""Numbers of the system's errors of a full disk and of a full quota."""


def is_full(error: BaseException | None) -> bool:
    """Tells whether an error comes from a full disk. HDF5 reports the number of the system's error in its
    text only, and sometimes in the error before the last one."""
    while error is not None:
        if getattr(error, "errno", None) in FULL or any(f"errno = {n}," in str(error) for n in FULL):
            return True
        error = error.__context__
    return False


class SimulationError(RuntimeError):
    """The error of a run that could not reach its end time.

    The message gives the time, the reason and what to try. result: the reason as a member of `RESULTS`."""

    def __init__(self, message: str, result: Any):
        super().__init__(message)
        self.result = result

    def __reduce__(self) -> tuple[type, tuple[str, Any]]:
        return type(self), (str(self), self.result)


def nearest(name: str, known: Iterable[str]) -> str:
    """The hint ` (perhaps `...`)` with the known name that is nearest to an unknown one, or with
    the first three of which it is a word; empty if there are none."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 1) or [x for x in known if name in re.split(r"[._]", x)]
    if not near:
        return ""
    *others, last = [f"`{x}`" for x in near[:3]]
    hint = f"{', '.join(others)} or {last}" if others else last
    return f" (perhaps {hint})"
