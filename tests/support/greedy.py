"""Functions of a user that reduce a member's history, some of which fail for some members."""

import os
import signal

import numpy as np


def swing(time, rows):
    """The difference of the largest and the smallest value."""
    return rows.max(0) - rows.min(0)


def raises(time, rows):
    """Fails for members that spin fast."""
    if turns_fast(rows):
        raise ZeroDivisionError("a member that fails")
    return rows[-1]


def greedy(time, rows):
    """Asks for 64 GiB for members that spin fast."""
    if turns_fast(rows):
        np.ones(2**33)
    return rows[-1]


def deadly(time, rows):
    """Ends its process for members that spin fast."""
    if turns_fast(rows):
        os.kill(os.getpid(), signal.SIGKILL)
    return rows[-1]


def wrong_shape(time, rows):
    """The mean over everything."""
    return rows.mean()


def turns_fast(rows):
    """Tells whether the rate in `spin_rate` at the beginning is above 4.05e-3 rad/s."""
    return abs(float(rows[0].ravel()[0])) > 4.05e-3
