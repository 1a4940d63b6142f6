"""Defines the cases: changes of a small sail, and its initial states.

The sail is the baseline (wind, bending, both dampings, hub) with three tethers of three elements. It is
small, so that a case takes seconds, but as stiff as a large sail: only the number of elements per tether
changes the stiffness of an element. Cases that differ in numbers only share compiled programs; cases with
another compiled structure form a group of their own.
"""

from dataclasses import dataclass, field

SPIN = 4e-3  # rad/s, the baseline's
MODULUS, AREA, SECOND_MOMENT = 70e9, 4.28e-9, 1.47e-18

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 3,
    "integrator.t_end": 200.0,
    "output.interval": 1.0,
}


@dataclass(frozen=True)
class Case:
    """One case.

    settings: scene keys that differ from `SMALL`; absent: tables or keys that are removed; start: initial
    state of `starts.py`; step [s] of both methods, None for their defaults."""

    name: str
    settings: dict = field(default_factory=dict)
    absent: tuple[str, ...] = ()
    start: str = ""
    step: float | None = None


def run_for(seconds: float, **settings) -> dict:
    """Settings with another end time and 200 saved instants."""
    return {"integrator.t_end": seconds, "output.interval": seconds / 200.0} | settings


def with_step(h: float) -> dict:
    """Settings for 200 fixed steps; every tenth is saved."""
    return {"integrator.t_end": 200 * h, "output.interval": 10 * h}


def bending(factor: float) -> dict:
    """Settings with the flexural rigidity times a factor."""
    return {"tethers.second_moment": SECOND_MOMENT * factor}


STIFF = {"tethers.youngs_modulus": MODULUS * 1e6} | bending(1e-6)

STEPS = [
    Case(f"step {h:g} s", with_step(h), step=h)
    for h in (1e-4, 1e-3, 1e-2, 0.1, 1.0, 5.0, 10.0, 30.0, 100.0)
]

STIFFNESS = [
    Case(f"EA x {factor:g}", {"tethers.youngs_modulus": MODULUS * factor, **bending(1.0 / factor)})
    for factor in (1e-3, 1e-2, 0.1, 10.0, 1e3, 1e6)
] + [Case(f"EI x {factor:g}", bending(factor)) for factor in (1.0, 1e3, 1e6, 1e9, 1e12)]

DAMPING = [
    Case(f"{kind} damping {time:g} s", {f"tethers.{kind}_damping_time": time})
    for kind in ("axial", "bending")
    for time in (0.0, 1e-3, 30.0, 1e3)
]

SPINS = [Case(f"spin x {x:g}", {"initial.spin_rate": SPIN * x}) for x in (0.0, 0.01, 0.1, 3.0, 10.0, 100.0)]

WIND = [Case(f"{volts:g} V", {"voltage.value": volts}) for volts in (0.0, 1e3, 100e3)]

ANGLES = [
    Case(f"alpha {angle:g} deg", {"initial.sailing_angle_deg": angle})
    for angle in (0.0, 1.0, 45.0, 89.0, 90.0)
]

LENGTHS = [Case(f"{length:g} m", {"tethers.length": length}) for length in (1.0, 100.0, 1e3, 100e3)]

REMOTE = [Case(f"remote {mass:g} kg", {"remote_units.mass": mass}) for mass in (0.0, 1e-3, 100.0, 1e4)]

STARTS = [
    Case("1 % too short", start="short 0.99"),
    Case("10 % too short", start="short 0.9"),
    Case("half an arc", start="arc 180"),
    Case("coil of one turn", start="arc 360"),
    Case("tips drawn in at 5 m/s", run_for(2000.0), start="inwards 5"),
    Case("slack, no spin, 100 kV", {"initial.spin_rate": 0.0, "voltage.value": 100e3}, start="short 0.99"),
]

TOGETHER = [
    Case("EA x 1e6, 1 % too short", STIFF, start="short 0.99"),
    Case("EA x 1e6, half an arc", STIFF, start="arc 180"),
    Case("EA x 1e6, axial damping 1000 s", STIFF | {"tethers.axial_damping_time": 1e3}, start="short 0.99"),
    Case("EI x 1e6, coil of one turn", bending(1e6), start="arc 360"),
    Case("EI x 1e9, half an arc", bending(1e9), start="arc 180"),
    Case(
        "EI x 1e6, bending damping 1000 s, coil",
        bending(1e6) | {"tethers.bending_damping_time": 1e3},
        start="arc 360",
    ),
    Case("remote 0 kg, half an arc", {"remote_units.mass": 0.0}, start="arc 180"),
    Case("remote 0 kg, no spin", {"remote_units.mass": 0.0, "initial.spin_rate": 0.0}),
    Case("lengths 10 m, 1 km, 100 km", {"tethers.length": [10.0, 1e3, 100e3]}),
    Case("EA x 1e-3, 1, 1e6", {"tethers.youngs_modulus": [MODULUS * f for f in (1e-3, 1.0, 1e6)],
         "tethers.second_moment": [SECOND_MOMENT / f for f in (1e-3, 1.0, 1e6)]}),
    Case("0, 20, 100 kV", {"voltage.value": [0.0, 20e3, 100e3]}),
    Case("spin x 100, 100 kV, coil", {"initial.spin_rate": 100 * SPIN, "voltage.value": 100e3},
         start="arc 360"),
    Case("90 % too short", start="short 0.1"),
    Case("coil of two turns", start="arc 720"),
    Case("hub of 6 mg", {"hub.density": 1e-6}),
    Case("hub of 1 mm", {"hub.radius": 1e-3, "hub.height": 1e-3}),
    Case("hub of 6e6 kg", {"hub.density": 1e6}),
    Case("wind x 1000", {"solar_wind.number_density": 7.3e9}),
    Case("tips drawn in at 500 m/s", start="inwards 500"),
    Case("coning 89 deg", {"initial.coning_angle_deg": 89.0}),
    Case("a day", run_for(86400.0)),
]  # fmt: skip

NO_DAMPING = ("tethers.axial_damping_time", "tethers.bending_damping_time")
UNDAMPED = [
    Case("no damping", absent=NO_DAMPING),
    Case("no damping, EA x 1e6", STIFF, absent=NO_DAMPING),
    Case("no damping, 1 % too short", absent=NO_DAMPING, start="short 0.99"),
    Case("no damping, half an arc", absent=NO_DAMPING, start="arc 180"),
]

CLAMPED = [
    Case(f"clamped, EI x {factor:g}", {"tethers.root": "clamped", **bending(factor)})
    for factor in (1.0, 1e6, 1e9, 1e12)
]

TRUSSES = {"tethers.element": "truss", "tethers.bending": False}
TRUSS = [
    Case("truss", TRUSSES, absent=("tethers.bending_damping_time",)),
    Case("truss, 1 % too short", TRUSSES, absent=("tethers.bending_damping_time",), start="short 0.99"),
]

FRAME = [
    Case("turning frame", absent=("hub",)),
    Case("turning frame, spin x 10", {"initial.spin_rate": 10 * SPIN}, absent=("hub",)),
    Case("turning frame, 100 kV", {"voltage.value": 100e3}, absent=("hub",)),
    Case("turning frame, 10 % too short", absent=("hub",), start="short 0.9"),
]

OTHER_STRAIN = {"tethers.strain": "engineering"}
SOFT = {"tethers.youngs_modulus": MODULUS * 1e-3, **bending(1e3)}
ENGINEERING = [
    Case("engineering strain", OTHER_STRAIN),
    Case("engineering strain, 1 % too short", OTHER_STRAIN, start="short 0.99"),
    Case("engineering strain, EA x 1e-3", OTHER_STRAIN | SOFT),
]


RELEASED = [
    Case("a tether released", {"event.time": [100.0], "event.release": [2]}),
    Case(
        "a tether released, slack",
        {"event.time": [100.25], "event.release": [2]},
        start="short 0.99",
    ),
    Case("all tethers released in turn", {"event.time": [50.0, 100.0, 150.0], "event.release": [3, 1, 2]}),
    Case(
        "a tether released, EA x 1e6",
        STIFF | {"event.time": [100.0], "event.release": [2]},
    ),
]


def size(count: int, elements: int, seconds: float) -> Case:
    """A case with other numbers of tethers and elements."""
    settings = {"tethers.count": count, "tethers.elements": elements}
    name = f"{count} tether{'s' * (count > 1)} x {elements}"
    return Case(name, run_for(seconds, **settings))


COUNTS = [[size(p, 1, 100.0)] for p in (1, 2, 100, 1000)]
ELEMENTS = [[size(1, n, 100.0)] for n in (10, 100, 1000)]

GROUPS = {
    "base": STEPS + STIFFNESS + DAMPING + SPINS + WIND + ANGLES + LENGTHS + REMOTE + STARTS + TOGETHER,
    "undamped": UNDAMPED,
    "clamped": CLAMPED,
    "truss": TRUSS,
    "frame": FRAME,
    "engineering": ENGINEERING,
    "release": RELEASED,
    **{f"{group[0].name}": group for group in COUNTS + ELEMENTS},
}
"""Cases by compiled structure."""
