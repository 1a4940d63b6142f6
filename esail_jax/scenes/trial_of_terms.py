"""The trial of a user's terms at an example of a state, before anything is compiled for a run."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, PerTether
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.coordinates import Coordinates
from esail_jax.equilibria.steady_stretch import along, unstretched_line
from esail_jax.joints import roots
from esail_jax.loads.law_structure import is_number
from esail_jax.loads.own_terms import Own, SampledWinchLaw, line_of, subject_of
from esail_jax.measurements import Measurements
from esail_jax.scenes.build import build_chain, system_of
from esail_jax.scenes.build_parts import starting_attitude
from esail_jax.scenes.own_terms import kind_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure, split
from esail_jax.system import System
from esail_jax.terms import WinchLaw

METHODS = {
    "Energy": "energy_density", "Dissipation": "rayleigh_density", "Load": "force", "TipLoad": "force",
    "HubLoad": "wrench", "Field": "acceleration", "WinchLaw": "tension",
}  # fmt: skip
"""The method that gives what a kind of term is."""

STRETCH = 1.0 + 1e-6
"""Stretch of the tethers in the trial: that of a taut tether."""


def try_terms(scene: Scene) -> None:
    """Raises SceneError for a number of a term that is not finite, and for what a term gives at the start
    of the scene if it has another shape, is not finite, or cannot be traced. With numbers that are tracers
    the values are not known, and shapes are seen when the run is traced."""
    for place, term in enumerate(scene.terms):
        check_numbers(term, place)
    structure, numbers = split(scene)
    if any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(numbers)):
        return
    finite = program_of(are_finite, (structure,), (numbers,), START_OPTIONS)(numbers)
    for place, (term, is_finite) in enumerate(zip(scene.terms, np.asarray(finite), strict=True)):
        if not is_finite:
            method = method_of(term)
            got = f"what {line_of(term, method)} returns at the start of the scene is not"
            raise SceneError(f"{subject_of(term, place)}.{method}", "be finite", got)


def check_numbers(term: Any, place: int) -> None:
    """Raises SceneError for a number of a term that is not finite."""
    for path, leaf in jax.tree_util.tree_flatten_with_path(term)[0]:
        if not is_number(leaf) or isinstance(leaf, jax.core.Tracer):
            continue
        if np.ma.is_masked(leaf):
            name = f"{subject_of(term, place)}{jax.tree_util.keystr(path)}"
            raise SceneError(name, "hold no masked numbers", f"has {np.ma.count_masked(leaf)}")
        if not np.isfinite(np.asarray(leaf)).all():
            name = f"{subject_of(term, place)}{jax.tree_util.keystr(path)}"
            line = line_of(term, method_of(term))
            raise SceneError(name, "be finite", f"is {leaf} (see {line})")


def method_of(term: Any) -> str:
    """The method that gives what a term is."""
    kind = kind_of(term) or ""
    return "update" if kind == "WinchLaw" and hasattr(term, "update") else METHODS[kind]


def tensions_of(law: WinchLaw, measured: Measurements) -> PerTether:
    """What a winch law gives for measurements, without what it may hold."""
    if isinstance(law, SampledWinchLaw):
        return law.sample(measured, law.first_memory(measured))[0]
    return law.tension(measured)


def are_finite(structure: Structure, numbers: Numbers) -> Bool[Array, " term"]:
    """Tells of every term of a scene whether all that it gives is finite at an example of a state: at the
    start, but for the steady stretch of the tethers."""
    if structure.has("chain"):
        chain, state = build_chain(structure, numbers)
        system, (q, v) = chain.system, chain.coordinates(state)
    else:
        system = system_of(structure, numbers)
        q, v = straight_start(system, numbers)
    by_place = {term.place: given for term, given in results(system, q, v)}
    finite = [[jnp.isfinite(x).all() for x in jax.tree.leaves(by_place[i])] for i in sorted(by_place)]
    return jnp.stack([jnp.stack(x).all() for x in finite])


def straight_start(system: System, numbers: Numbers) -> tuple[Coordinates, Coordinates]:
    """Positions and velocities of straight tethers, all but unstretched, that turn with the hub."""
    axes, _ = starting_attitude(numbers)
    outward = axes @ system.roots.radial_directions
    omega = roots.spin_vector(axes, numbers["initial.spin_rate"])
    hub = hub_velocity = None
    tether = along(STRETCH * unstretched_line(system.tethers), outward)
    if system.hub is not None:
        hub = system.hub.base_points @ axes.T
        hub_velocity = jnp.cross(omega, hub)
        tether = tether.at[0].add(system.roots.positions(hub)[:, None])
    velocity = jnp.cross(omega, tether, axisb=1, axisc=1)
    reel = reel_rate = None
    if system.has_unknown_lengths:
        reel, reel_rate, _ = system.payout.at_start()
    return Coordinates(tether, hub, reel=reel), Coordinates(velocity, hub_velocity, reel=reel_rate)


def results(system: System, q: Coordinates, v: Coordinates) -> Iterator[tuple[Own, Any]]:
    """The terms of a user, and what they give at a state."""
    time = jnp.zeros(())
    system = system.with_commanded_loads(time, q, v)
    fields, rates = system.tethers.interpolate_motion(q.tether, v.tether)
    for term in (*system.energies, *system.dissipations, *system.loads):
        if isinstance(term, Own):
            yield term, [x for x in term.point_forces(time, fields, rates) if x is not None]
    if any(isinstance(term, Own) for term in system.tip_loads):
        measured = system.all_measurements(time, q, v)
        yield from ((term, term.force(measured)) for term in system.tip_loads if isinstance(term, Own))
    if system.winch_laws:
        measured = system.all_measurements(time, q, v)
        yield from ((law, tensions_of(law, measured)) for law in system.winch_laws)
    for load in system.hub_loads:
        yield load, load.wrench(system.hub_motion(time, q, v))
    for field in system.fields:
        if isinstance(field, Own):
            yield field, field.at_nodes(time, q.tether, v.tether)
