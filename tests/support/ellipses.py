"""Motions on Kepler ellipses, by the eccentric anomaly."""

import numpy as np


class Ellipse:
    """A motion with a semi-major axis, an eccentricity, a period [s] and the mean anomaly at the time 0, in
    a plane that is tilted by asin 0.6 about the line of apsides, which is the X axis."""

    def __init__(self, axis, eccentricity, period, phase):
        self.axis, self.eccentricity = axis, eccentricity
        self.rate, self.phase = 2.0 * np.pi / period, phase

    def anomaly(self, t):
        mean = self.rate * t + self.phase
        anomaly = mean
        for _ in range(60):
            anomaly = mean + self.eccentricity * np.sin(anomaly)
        return anomaly

    def position(self, t):
        """Shape (3, n)."""
        anomaly = self.anomaly(t)
        y = np.sqrt(1.0 - self.eccentricity**2) * np.sin(anomaly)
        return self.axis * np.array([np.cos(anomaly) - self.eccentricity, 0.8 * y, 0.6 * y])

    def velocity(self, t):
        """Shape (3, n), per second."""
        anomaly = self.anomaly(t)
        y = np.sqrt(1.0 - self.eccentricity**2) * np.cos(anomaly)
        along = np.array([-np.sin(anomaly), 0.8 * y, 0.6 * y])
        return self.axis * self.rate * along / (1.0 - self.eccentricity * np.cos(anomaly))
