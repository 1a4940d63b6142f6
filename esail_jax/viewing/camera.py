"""A camera with perspective. The page does the same in JavaScript (`web/pure.js`); a test compares the
two."""

import dataclasses

import numpy as np

DISTANCE = 5.0
"""Distance of the camera from the middle, as a multiple of the picture's radius."""

FILLED = 0.42
"""The radius of the picture, as a part of its smaller side."""


@dataclasses.dataclass(frozen=True)
class Camera:
    """A camera that looks at the origin.

    yaw, pitch: angles [rad] about the upward axis and then about that to the right; radius: [m]; width,
    height: of the picture [pixel]; zoom: factor of the picture's size."""

    yaw: float
    pitch: float
    radius: float
    width: float
    height: float
    zoom: float = 1.0

    def turn(self) -> np.ndarray:
        """The rotation (3, 3) from the axes of the first view (right, up, towards the viewer) to
        those of the camera."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        k, t = np.cos(self.pitch), np.sin(self.pitch)
        about_up = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        about_right = np.array([[1.0, 0.0, 0.0], [0.0, k, -t], [0.0, t, k]])
        return about_right @ about_up

    @property
    def distance(self) -> float:
        """Distance of the camera from the origin [m]."""
        return DISTANCE * self.radius

    def enlargement(self, points: np.ndarray) -> np.ndarray:
        """The factor D / (D - z) of points (..., 3) at the depth z towards the viewer, with the
        distance D of the camera; NaN at or behind the camera."""
        gap = self.distance - points[..., 2]
        return self.distance / np.where(gap > 0.01 * self.distance, gap, np.nan)

    def project(self, points: np.ndarray) -> np.ndarray:
        """The pixels (..., 2), from the upper left corner, of points (..., 3) in camera axes
        [m]."""
        scale = self.zoom * FILLED * min(self.width, self.height) / self.radius
        size = scale * self.enlargement(points)
        x = 0.5 * self.width + size * points[..., 0]
        y = 0.5 * self.height - size * points[..., 1]
        return np.stack([x, y], axis=-1)
