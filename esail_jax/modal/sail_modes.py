"""`modes`: the modes of a scene's sail about its spinning equilibrium, with their names."""

import dataclasses
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Rotation
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.elements.deployment import ExponentialPayout
from esail_jax.errors import SimulationError
from esail_jax.modal.floquet import Moving
from esail_jax.modal.floquet import floquet as multipliers_of
from esail_jax.modal.naming import named_group
from esail_jax.modal.notes import floquet_notes, notes_of
from esail_jax.modal.shapes import Shape
from esail_jax.modal.solving import Solved, solve
from esail_jax.modal.steady_load import check_has_modes, check_has_orbit, with_mean_loads
from esail_jax.modal.table import ModeTable
from esail_jax.scenes.build import Model, build
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure, split
from esail_jax.steppers.results import RESULTS
from esail_jax.system import System

Host = np.ndarray


def modes(
    source: "str | os.PathLike | Scene",
    overrides: Mapping[str, Any] | None = None,
    *,
    count: int | None = None,
    converge: bool = True,
    floquet: bool = False,
    terms: Any = None,
) -> ModeTable:
    """The modes of a sail about its spinning equilibrium, as seen in the frame B that turns with
    it.

    With wind, the equilibrium is the steady cone that accelerates uniformly along the spin axis, under the
    load averaged over a turn; at a sailing angle of 0 that is the load itself. Unequal tethers are allowed.
    The sailing angle does not matter without wind. Axial and radial forces on the remote units belong to
    the equilibrium, and as they turn with the sail, to the stiffness.

    source, overrides: the scene, as for `simulate`. count: number of modes, those of the lowest
    frequencies; None: all, of large sails with unequal tethers the lowest LOWEST (`solving.py`). converge:
    also solve with twice as many elements, for `relative_change`. floquet: also find the periodic orbit at
    the scene's sailing angle and its multipliers (`Floquet`), which takes about two minutes for the
    baseline; it needs a hub and wind. terms: energies and dissipations of your own (`physics.py`).

    The result is not differentiable. Raises SceneError if the scene has no steady spinning state, and
    SimulationError if none is found.
    """
    scene = load_scene(source, overrides if terms is None else {**(overrides or {}), OWN_TERMS: terms})
    check_has_modes(scene)
    if floquet:
        check_has_orbit(scene)
    moving = solved_scene(scene, None if floquet else count)
    table = assembled(scene, moving.found, None if floquet else count)
    if floquet:
        table = with_floquet(table, moving, count)
    if not converge:
        return table
    elements = 2 * scene.tethers.elements
    finer_sail = solved_scene(scene.replace({"tethers.elements": elements}), count)
    finer = assembled(scene, finer_sail.found, None)
    return with_changes(table, finer)


def with_floquet(table: ModeTable, moving: Moving, count: int | None) -> ModeTable:
    """The table with the multipliers, and of the modes the first `count`. Raises
    SimulationError."""
    floquet = multipliers_of(table, moving)
    table = dataclasses.replace(table, floquet=floquet, notes=(*table.notes, *floquet_notes(floquet)))
    return table if count is None else table.first(count)


def solved_scene(scene: Scene, count: int | None) -> Moving:
    """The system of a scene, its equilibrium and its spectrum. Raises SimulationError without
    equilibrium."""
    structure, numbers = split(with_method(scene))
    program = program_of(start_of, (structure,), (numbers,), START_OPTIONS)
    first: Start = program(numbers)
    system, axes = first.model.system, np.asarray(first.axes)
    spin = float(np.asarray(scene.initial.spin_rate))
    solved = solve(first.under_mean_loads, first.model.q, axes, spin, count)
    if not bool(solved.at.converged):
        left = float(solved.at.unbalanced)
        advice = "Try a faster spin, a weaker load or tethers under tension."
        if scene.tip_thrust is not None:
            advice = (
                "Forces on the remote units of unequal tethers tilt the hub, and then change the spin: try "
                "equal tethers with equal forces, or a weaker force."
            )
        raise SimulationError(
            f"No steady spinning state was found: a force of {left:.1e} N is left. {advice}",
            RESULTS.nonfinite,
        )
    return Moving(solved, system, axes)


class Start(NamedTuple):
    """A sail at its start: the model, the axes of its hub C_B^I, and the system under the mean of its loads
    over a turn."""

    model: Model
    axes: Rotation
    under_mean_loads: System


def start_of(structure: Structure, numbers: Numbers) -> Start:
    """The start of a scene, from its structure and numbers."""
    model = held(build(structure, numbers))
    axes = model.system.rotation(jnp.zeros(()), model.q)
    return Start(model, axes, with_mean_loads(model.system, axes))


def held(model: Model) -> Model:
    """The model whose winches hold the lengths of the start; without them the model itself."""
    system = model.system
    if system.payout is None:
        return model
    start = system.payout.at_start().length
    zero = jnp.zeros(())
    still = dataclasses.replace(
        system, payout=ExponentialPayout(system.payout.total, start, jnp.zeros_like(start))
    )
    q, v = (x._replace(reel=None) for x in (model.q, model.v))
    return model._replace(system=still.paid_out(zero), q=q, v=v)


def assembled(scene: Scene, solved: Solved, count: int | None) -> ModeTable:
    """The table of modes from the spectra of all groups of motions."""
    known: dict[int, Shape] = {}
    entries = [
        (entry, place)
        for place, group in enumerate(solved.groups)
        for entry in named_group(solved.system, group, solved.places, solved.spin, known)
    ]
    entries.sort(key=lambda pair: (pair[0].natural_frequency, pair[0].n, pair[0].name))
    entries = entries[:count]
    each = [entry for entry, _ in entries]
    return ModeTable(
        frequency_hz=np.array([e.natural_frequency for e in each]) / (2.0 * np.pi),
        damping_ratio=np.array([e.damping_ratio for e in each]),
        name=tuple(e.name for e in each),
        eigenvalue=np.array([e.eigenvalue for e in each], complex),
        wave_number=np.array([e.n for e in each], int),
        kind=tuple(e.kind for e in each),
        nodes=np.array([e.nodes for e in each], int),
        relative_change=np.full(len(each), np.nan),
        notes=notes_of(scene, solved),
        coning_angle=solved.coning_angle,
        acceleration=solved.acceleration,
        spin_rate=solved.spin,
        motions=tuple((place, entry.motion, entry.conjugate) for entry, place in entries),
        groups=tuple(group.shapes for group in solved.groups),
        places=solved.places,
        system=solved.system,
    )


def with_changes(table: ModeTable, finer: ModeTable) -> ModeTable:
    """The table with the change of every mode to the nearest one of the same name in a finer
    discretisation."""
    by_name: dict[str, list[complex]] = {}
    for name, value in zip(finer.name, finer.eigenvalue, strict=True):
        by_name.setdefault(name, []).append(value)
    change = np.full(len(table), np.nan)
    for k, (name, value) in enumerate(zip(table.name, table.eigenvalue, strict=True)):
        if name in by_name:
            change[k] = np.abs(np.array(by_name[name]) - value).min() / abs(value)
    return dataclasses.replace(table, relative_change=change)
