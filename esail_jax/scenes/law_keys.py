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
    "phase-window",
    "python",
]
ThrustLawName = Literal["linear", "debye-sheath"]

LIMITS = ("maximum", "limit_blend")
"""Keys of the limits of the voltages, which every law takes."""

LAWS: dict[LawName, tuple[str, ...]] = {
    "constant": ("value", "maximum", "slew_rate"),
    "harmonic": ("value", "cosine", "sine", *LIMITS, "slew_rate"),
    "piecewise-linear": ("value", "time", "table", *LIMITS, "slew_rate"),
    "on-off": ("value", "on", "off", "rise_time", *LIMITS, "slew_rate"),
    "feedback": ("value", "gain", "target_sailing_angle_deg", "measured_axis", *LIMITS, "slew_rate"),
    "planar-cone": ("coning_angle_deg", "spin_rate", *LIMITS, "slew_rate"),
    "constant-thrust": ("thrust", *LIMITS),
    "phase-window": ("value", "on_phase_deg", "off_phase_deg", "rise_phase_deg", *LIMITS),
    "python": ("value", *LIMITS, "slew_rate"),
}
"""Modulation laws of the voltage, and the keys that each law takes."""

THRUST_LAWS: dict[ThrustLawName, tuple[str, ...]] = {
    "linear": ("cutoff_voltage",),
    "debye-sheath": ("electron_temperature_ev", "tether_radius"),
}
"""Laws of the thrust, and the keys that each law needs; all others are for other laws."""

OPTIONAL_LAW_KEYS = ("cosine", "sine", "off", "measured_axis", *LIMITS, "slew_rate")
"""Keys that a law takes but does not require."""
