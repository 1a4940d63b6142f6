"""Names of the voltage laws and of the thrust laws, and the keys that each of them takes."""

from typing import Literal

LawName = Literal[
    "constant",
    "harmonic",
    "piecewise-linear",
    "on-off",
    "feedback",
    "planar-cone",
    "constant-thrust",
    "python",
]
ThrustLawName = Literal["linear", "debye-sheath"]

LAWS: dict[LawName, tuple[str, ...]] = {
    "constant": ("value", "maximum", "slew_rate"),
    "harmonic": ("value", "cosine", "sine", "maximum", "slew_rate"),
    "piecewise-linear": ("value", "time", "table", "maximum", "slew_rate"),
    "on-off": ("value", "on", "off", "rise_time", "maximum", "slew_rate"),
    "feedback": ("value", "gain", "target_sailing_angle_deg", "measured_axis", "maximum", "slew_rate"),
    "planar-cone": ("coning_angle_deg", "spin_rate", "maximum", "slew_rate"),
    "constant-thrust": ("thrust", "maximum"),
    "python": ("value", "maximum", "slew_rate"),
}
"""Modulation laws of the voltage, and the keys that each law takes."""

THRUST_LAWS: dict[ThrustLawName, tuple[str, ...]] = {
    "linear": ("cutoff_voltage",),
    "debye-sheath": ("electron_temperature_ev", "tether_radius"),
}
"""Laws of the thrust, and the keys that each law needs; all others are for other laws."""

OPTIONAL_LAW_KEYS = ("cosine", "sine", "off", "measured_axis", "maximum", "slew_rate")
"""Keys that a law takes but does not require."""
