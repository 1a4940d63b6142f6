"""What a scene knows of each method of time integration: `METHODS`, one entry per method.

`consistency` reads from this table which keys and models a method takes, `method_choice` the defaults of
its keys. A stepper from outside the package has no entry. Nothing may therefore look a name up without
`METHODS.get` or `takes`: the keys of such a method are neither checked nor completed."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

MethodName = Literal["generalized-alpha", "energy-momentum", "collocation", "tsit5", "dopri5", "dopri8"]

PAPER_STEP = 0.1
"""Step of [PGV] Sec. 4 [s]."""

PAPER_SPECTRAL_RADIUS = 0.25
"""Spectral radius of generalized-alpha in [PGV] Sec. 4."""

COLLOCATION_TOLERANCE = 5e-10
"""Local error of a sail's positions relative to the length of its tethers. Every observable of the built-in
scenes is then accurate to 1e-3 of its range with a margin, and the energy of a free sail to better than
1e-9."""

EXPLICIT_TOLERANCE = 1e-9
"""Relative local error of the explicit methods: tip positions of the built-in chains have nine correct
digits or more."""


@dataclasses.dataclass(frozen=True)
class Method:
    """Properties of a method of time integration that decide which scenes it can run.

    keys: the keys of [integrator] that it takes beside `t_end` and `method`; defaults: values of those keys
    where a scene leaves them out (a default tolerance applies only where no step is given, as the two
    exclude each other); sails, chains: the models that it runs; chain_bending: whether chains may have
    bending stiffness; events: whether tethers may be released during a run; explicit: whether a stability
    limit bounds its step; tolerance_from_strain: whether the default tolerance is lowered for tethers that
    hardly stretch (`method_choice.sail_tolerance`)."""

    keys: tuple[str, ...]
    defaults: Mapping[str, float]
    sails: bool = False
    chains: bool = False
    chain_bending: bool = False
    events: bool = False
    explicit: bool = False
    tolerance_from_strain: bool = False

    @property
    def controls_error(self) -> bool:
        """Whether the method chooses its steps by an error estimate, unless a step is given."""
        return "tolerance" in self.keys


EXPLICIT_RUNGE_KUTTA = Method(
    keys=("step", "tolerance"),
    defaults={"tolerance": EXPLICIT_TOLERANCE},
    chains=True,
    chain_bending=True,
    explicit=True,
)

METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "generalized-alpha": Method(
            keys=("step", "spectral_radius"),
            defaults={"step": PAPER_STEP, "spectral_radius": PAPER_SPECTRAL_RADIUS},
            sails=True,
            chains=True,
            events=True,
        ),
        "energy-momentum": Method(keys=("step",), defaults={"step": PAPER_STEP}, sails=True, events=True),
        "collocation": Method(
            keys=("step", "tolerance"),
            defaults={"tolerance": COLLOCATION_TOLERANCE},
            sails=True,
            events=True,
            tolerance_from_strain=True,
        ),
        "tsit5": EXPLICIT_RUNGE_KUTTA,
        "dopri5": EXPLICIT_RUNGE_KUTTA,
        "dopri8": EXPLICIT_RUNGE_KUTTA,
    }
)

SAIL_METHOD = "collocation"
"""Method of a sail that names none: it controls its error."""

SAIL_STEP_METHOD = "generalized-alpha"
"""Method of a sail that gives a step or a spectral radius but names no method."""

CHAIN_METHOD = "dopri8"
"""Method of a chain that names none, if the number of its steps is acceptable: explicit, of order eight."""

STIFF_CHAIN_METHOD = "generalized-alpha"
"""Method of a chain that would need too many explicit steps: implicit."""

FIXED_STEP = tuple(name for name, method in METHODS.items() if not method.controls_error)
"""Methods with one step size and no error control."""


def takes(name: str, key: str) -> bool:
    """Tells whether a method takes a key of [integrator]. Methods from outside the package take every
    key."""
    return name not in METHODS or key in METHODS[name].keys
