"""MATLAB's ode45, with which the paper's runs were made, reimplemented in NumPy.

The method is the pair 5(4) of Dormand and Prince. The largest |error_i| / max(|y_i|, AbsTol/RelTol) must
be below RelTol (RelTol 1e-3 and AbsTol 1e-6 by default); a step is at most a tenth of the duration. Output
at given times, here every 1e-4 s, is interpolated within steps by a polynomial of degree 4. The code was
written from memory of the published algorithm and was not compared with MATLAB. It uses no code of
esail_jax.
"""

import numpy as np
from chains import DIRECTIONS, Chain

A = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
DENSE = np.array(  # stage, power of the position within the step, 1 to 4
    [
        [1.0, -183 / 64, 37 / 12, -145 / 128],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 1500 / 371, -1000 / 159, 1000 / 371],
        [0.0, -125 / 32, 125 / 12, -375 / 64],
        [0.0, 9477 / 3392, -729 / 106, 25515 / 6784],
        [0.0, -11 / 7, 11 / 3, -55 / 28],
        [0.0, 3 / 2, -4.0, 5 / 2],
    ]
)
POWER = 1 / 5


def rate_of(chain: Chain, direction: str):
    """The function y -> y' for y = (x, x'), (2, n, 3)."""
    acceleration = chain.acceleration(DIRECTIONS[direction], np.float64)
    return lambda y: np.stack([y[1], acceleration(y[0])])


def stages_of(rate, y, slope, h):
    """The end of a step and its seven slopes; the last slope belongs to the end."""
    k = [slope]
    for row in A:
        end = y + h * np.tensordot(row, k, 1)
        k.append(rate(end))
    return end, np.stack(k)


def step(rate, y, slope, h, relative, absolute):
    """Makes one accepted step; returns its end, its slopes, its size and the next size to try."""
    failed = False
    while True:
        end, k = stages_of(rate, y, slope, h)
        size = np.maximum(np.maximum(np.abs(y), np.abs(end)), absolute / relative)
        error = h * np.max(np.abs(np.tensordot(ERROR, k, 1)) / size)
        if error <= relative:
            break
        h *= 0.5 if failed else max(0.1, 0.8 * (relative / error) ** POWER)
        failed = True
    wanted = 1.25 * (error / relative) ** POWER
    return end, k, h, h if failed else h / max(wanted, 0.2)


def ode45(chain: Chain, direction: str, relative=1e-3, absolute=1e-6, printed=1e-4):
    """Times [s], states (time, 2, n, 3) and the number of steps; printed [s]: interval of
    output."""
    rate, y, t, steps = rate_of(chain, direction), np.stack(chain.start()), 0.0, 0
    times = np.linspace(0.0, chain.duration, round(chain.duration / printed) + 1)
    states, slope, longest = [y[None]], rate(y), 0.1 * chain.duration
    first = np.max(np.abs(slope) / np.maximum(np.abs(y), absolute / relative)) / (0.8 * relative**POWER)
    h, done = min(longest, printed, 1.0 / first), 1
    while done < len(times):
        h = min(h, longest, chain.duration - t)
        end, k, h, ahead = step(rate, y, slope, h, relative, absolute)
        last = t + h >= chain.duration * (1 - 1e-12)
        until = len(times) if last else np.searchsorted(times, t + h, "right")
        place = ((times[done:until] - t) / h)[:, None] ** np.arange(1, 5)
        if len(place):
            states.append(y + h * np.tensordot(place @ DENSE.T, k, 1))
        y, slope, t, h, done, steps = end, k[-1], t + h, ahead, until, steps + 1
    return times, np.concatenate(states), steps
