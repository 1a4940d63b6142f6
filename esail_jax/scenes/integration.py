"""The tables [integrator] and [output], what a scene knows of each method of time integration, and the
sizes that no machine can compute.

`METHODS` has one entry per method: which keys and models it takes, and the defaults of its keys. A stepper
from outside the package has no entry. Nothing may therefore look a name up without `METHODS.get` or
`takes`: the keys of such a method are neither checked nor completed.

Sizes are refused before anything is compiled: the memory of the model, the number of saved instants, and
the number of fixed steps. The memory is measured: a sail by collocation takes 0.35 GB plus some 50 kB for
every element (12 x 4000 elements: 2.7 GB). A rod of a chain takes less than 10 kB.
"""

import dataclasses
import os
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Literal

from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, table
from esail_jax.scenes.rules import Number, SceneError, between, choice, positive

MethodName = Literal["generalized-alpha", "energy-momentum", "collocation", "tsit5", "dopri5", "dopri8"]


@table
class Integrator:
    """Time integration. Without `method` the package chooses one: collocation for a sail, for a chain an
    explicit method, or an implicit one if its rods vibrate fast. The method chooses its step or
    tolerance."""

    t_end: float = declare(positive, structure=True, unit="s", doc="End time.")
    method: MethodName | None = declare(
        choice(MethodName), unit="-", doc="Method of time integration; chosen if left out.", default=None
    )
    step: float | None = declare(
        positive,
        structure=True,
        unit="s",
        doc="Fixed step size; methods with error control then use it in place of a tolerance.",
        default=None,
    )
    spectral_radius: Number | None = declare(
        between("[0, 1]"),
        unit="-",
        doc="Spectral radius of generalized-alpha at infinite frequency.",
        default=None,
    )
    tolerance: Number | None = declare(
        between("[1e-16, 1)"),
        unit="-",
        doc="Relative local error of methods with error control.",
        default=None,
    )


@table
class Output:
    """Instants at which observables are saved."""

    interval: float = declare(
        positive,
        structure=True,
        unit="s",
        doc="Time between saved instants; t_end/1000 without this table.",
    )


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


def method_name(scene: Any) -> str | None:
    """The method that a scene names, or the default of sails. None for a chain that names no method: its
    method is chosen when it is run, as are step and tolerance (`scenes/method_choice.py`)."""
    table = scene.integrator
    if table.method is not None or scene.chain is not None:
        return table.method
    stepped = table.step is not None or table.spectral_radius is not None
    return SAIL_STEP_METHOD if stepped else SAIL_METHOD


def quoted(names: Iterable[str]) -> str:
    """Names in words: `"a" or "b"`."""
    return " or ".join(f'"{name}"' for name in names)


def check_integrator(scene: Any) -> None:
    """Checks that the method runs such a scene, and takes the keys of [integrator] that are given. Raises
    SceneError."""
    if scene.chain is None:
        check_method_of_sail(scene)
    else:
        check_method_of_chain(scene)
    table, method = scene.integrator, method_name(scene)
    if table.tolerance is not None and method is not None and not takes(method, "tolerance"):
        raise SceneError("integrator.tolerance", f"be left out with {method}", "is given")
    if table.spectral_radius is not None and (method is None or not takes(method, "spectral_radius")):
        others = " or ".join(name for name in METHODS if takes(name, "spectral_radius"))
        raise SceneError("integrator.spectral_radius", f"be left out without {others}", "is given")
    if table.tolerance is not None and table.step is not None:
        raise SceneError("integrator.tolerance", "be left out with a fixed `integrator.step`", "is given")


def check_method_of_sail(scene: Any) -> None:
    """Checks that the method runs sails, and such a one. Raises SceneError."""
    name = method_name(scene)
    method = None if name is None else METHODS.get(name)
    if method is not None and not method.sails:
        must = f"be {quoted(x for x, other in METHODS.items() if other.sails)} for a sail"
        raise SceneError("integrator.method", must, rules.describe(name))
    if method is not None and scene.event is not None and not method.events:
        must = f"be {quoted(x for x, other in METHODS.items() if other.events)} with events"
        raise SceneError("integrator.method", must, rules.describe(name))
    radius = scene.integrator.spectral_radius
    limited = radius is not None and (scene.hub is not None or scene.tethers.root == "clamped")
    known = rules.known(radius) if limited else None
    if known is not None and known >= 1.0:
        raise SceneError(
            "integrator.spectral_radius", "be below 1 with constraints", rules.describe(radius)
        )


def check_method_of_chain(scene: Any) -> None:
    """Checks that the method runs chains, and such a one. Raises SceneError."""
    name = scene.integrator.method
    method = METHODS.get(name)
    if method is not None and not method.chains:
        implicit = quoted(x for x, other in METHODS.items() if other.chains and not other.explicit)
        must = f"be {implicit} or an explicit one for a chain"
        raise SceneError("integrator.method", must, f'is "{name}"')
    if scene.chain.bending and method is not None and not method.chain_bending:
        must = "be an explicit one with `chain.bending`"
        raise SceneError("integrator.method", must, f'is "{name}"')


BYTES_PER_ELEMENT, BYTES_PER_ROD = 50_000, 10_000
"""Memory [bytes] of an element of a sail, and of a rod of a chain."""


MOST_INSTANTS = 10**8
"""Largest number of saved instants: 1 GB for every number of an observable."""


MOST_STEPS = 10**12
"""Largest number of fixed steps: a year of computing at 30 us a step."""


def memory_of_machine() -> float:
    """The memory [bytes] of this machine, infinite where it cannot be asked for."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return float("inf")


def check_size(scene: Any) -> None:
    """Raises SceneError for a scene that is too large for this machine, or whose run has no end."""
    if scene.chain is not None:
        key, count, each = "chain.rods", scene.chain.rods, BYTES_PER_ROD
    else:
        tethers = scene.tethers
        count, each = tethers.count * tethers.elements, BYTES_PER_ELEMENT
        key = "tethers.elements" if tethers.elements > tethers.count else "tethers.count"
    room = memory_of_machine()
    if count * each > room:
        must = f"leave a model that fits into this machine's {room / 1e9:.0f} GB"
        raise SceneError(key, must, f"makes {count:.3g} elements, some {count * each / 1e9:.3g} GB")
    t_end, interval, step = scene.integrator.t_end, scene.output.interval, scene.integrator.step
    if t_end > MOST_INSTANTS * interval:
        must = f"leave at most {MOST_INSTANTS:.0e} saved instants"
        raise SceneError("output.interval", must, f"is {interval:g} with `integrator.t_end` = {t_end:g}")
    if step is not None and t_end > MOST_STEPS * step:
        must = f"leave at most {MOST_STEPS:.0e} steps"
        raise SceneError("integrator.step", must, f"is {step:g} with `integrator.t_end` = {t_end:g}")
