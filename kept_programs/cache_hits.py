"""Counts the programs that JAX takes from its own compilation cache."""

import threading
from typing import Any

import jax


class CacheHits(threading.local):
    """The number of programs that JAX's own compilation cache has given to this thread."""

    count = 0

    def listen(self, event: str, **_: Any) -> None:
        """Counts, if the event is such a hit."""
        self.count += event == "/jax/compilation_cache/cache_hits"


HITS = CacheHits()
jax.monitoring.register_event_listener(HITS.listen)
