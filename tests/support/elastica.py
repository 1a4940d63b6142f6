"""The inextensible elastica in closed form."""

import numpy as np
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

TIP_ANGLE = np.deg2rad(50.0)


def elliptic(tip_angle):
    """alpha^2, and tip (along, down) / L of the inextensible cable."""
    m = 0.5 * (1.0 + np.sin(tip_angle))
    phi = np.arcsin(1.0 / np.sqrt(2.0 * m))
    alpha = ellipk(m) - ellipkinc(phi, m)
    along = np.sqrt(2.0 * np.sin(tip_angle)) / alpha
    return alpha**2, np.array([along, 1.0 - 2.0 * (ellipe(m) - ellipeinc(phi, m)) / alpha])
