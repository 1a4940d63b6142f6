"""The errors that users meet. This module imports no library: the command line needs it before JAX."""

from typing import Any


class InputError(ValueError):
    """Input that cannot be used as given: a scene (`SceneError`), a run file (`RunFileError`), or a command
    line. The message is one line."""


class SimulationError(RuntimeError):
    """The error of a run that could not reach its end time.

    The message gives the time, the reason and what to try. result: the reason as a member of `RESULTS`."""

    def __init__(self, message: str, result: Any):
        super().__init__(message)
        self.result = result
