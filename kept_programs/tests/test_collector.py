"""The pause of the garbage collector: overlapping pauses, and a collector that was off before."""

import gc
import threading

import pytest

from kept_programs.collector import collector_paused


def test_the_collector_resumes_after_the_last_of_two_overlapping_pauses():
    """Two threads pause the collector. It is off until both have ended."""
    begun, may_end = threading.Event(), threading.Event()

    def pause():
        with collector_paused():
            begun.set()
            may_end.wait(10.0)

    other = threading.Thread(target=pause)
    with collector_paused():
        other.start()
        assert begun.wait(10.0)
        assert not gc.isenabled()
    assert not gc.isenabled()
    may_end.set()
    other.join()
    assert gc.isenabled()


def test_a_collector_that_is_off_stays_off_and_an_error_ends_the_pause():
    """The user's own setting is kept; an exception inside the pause resumes the collector."""
    gc.disable()
    try:
        with collector_paused():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
    with pytest.raises(ValueError, match="inside"), collector_paused():
        raise ValueError("inside")
    assert gc.isenabled()
