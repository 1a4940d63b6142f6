"""What a process remembers of programs: functions whose results are kept, and executables in memory.

A program in memory takes 10 to 200 MB, and some hundred memory mappings, of which Linux allows a process
65,530: the compilation that needs one more ends the process. The most recently used executables stay;
others go, and are loaded from the store when they are needed again (a program that is not kept
there is compiled again).
"""

import functools
import gc
import threading
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

from kept_programs.memory import returning_freed_memory

MOST_EXECUTABLES = 64
"""Largest number of executables in memory. A scene needs four for its run and five for its gradient."""

LEAST_EXECUTABLES = 16
"""Number of executables that always stay: run, gradient and second derivative of a scene need fewer. With
less room every call would load its programs again."""

MAPPINGS = Path("/proc/self/maps")
"""Linux lists the memory mappings of the process here, one a line."""

MOST_MAPPINGS = 32_000
"""Largest number of mappings with which all executables stay: half of what Linux allows."""

FUNCTIONS: list[Any] = []
"""Functions whose results are kept."""


def remembered(maxsize: int) -> Callable[[Callable], Any]:
    """Decorator: as `functools.lru_cache`, and emptied by `clear_caches`."""

    def decorate(function: Callable) -> Any:
        cached = functools.lru_cache(maxsize)(function)
        FUNCTIONS.append(cached)
        return cached

    return decorate


def mappings() -> int:
    """The number of memory mappings of this process, 0 where the system does not list them."""
    try:
        return MAPPINGS.read_bytes().count(b"\n")
    except OSError:
        return 0


class RecentlyUsed:
    """Objects in the order of their last use, of which at most `most` stay, and half of them, at least
    `least`, if the process has more than MOST_MAPPINGS when another one comes. An object that leaves is
    told so by its method `forget`."""

    def __init__(self, most: int, least: int = 1):
        self.most, self.least = most, least
        self._objects: OrderedDict[Any, None] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._objects)

    def use(self, one: Any) -> None:
        """Notes that an object is used now."""
        with self._lock:
            is_new = one not in self._objects
            self._objects[one] = None
            self._objects.move_to_end(one)
            count = len(self._objects)
            crowded = is_new and count > self.least and mappings() > MOST_MAPPINGS
            stay = max(count // 2 + 1, self.least) if crowded else self.most
            left = [self._objects.popitem(last=False)[0] for _ in range(count - stay)]
        for other in left:
            other.forget()

    def clear(self) -> None:
        """Lets all objects go."""
        with self._lock:
            left = list(self._objects)
            self._objects.clear()
        for other in left:
            other.forget()


EXECUTABLES = RecentlyUsed(MOST_EXECUTABLES, LEAST_EXECUTABLES)
"""The programs whose executables are in memory."""


@returning_freed_memory()
def clear_caches() -> None:
    """Frees the memory of the programs of this process, those of JAX included (`jax.clear_caches`). What
    is needed again is loaded from the store, or compiled."""
    EXECUTABLES.clear()
    for function in FUNCTIONS:
        function.cache_clear()
    jax.clear_caches()
    gc.collect()
