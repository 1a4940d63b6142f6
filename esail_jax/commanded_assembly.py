"""An assembly at an instant, and what its control laws measure and command there."""

import dataclasses
from typing import TypeVar, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Instants, PerTether, Scalar
from esail_jax.assembly import Assembly
from esail_jax.coordinates import Coordinates
from esail_jax.elements.deployment import Deployed, Reels, ScheduledPayout, deployed_tethers
from esail_jax.elements.thermal import ThermalEnergy
from esail_jax.environment.kepler_orbit import at_place
from esail_jax.measurements import Measurements
from esail_jax.sensors import angular_velocity, with_motion
from esail_jax.terms import ControlledLoad, Energy, has_kinks, needs_command

Assembled = TypeVar("Assembled", bound="CommandedAssembly")
"""The class of what a method gives: that of what has the method, such as a `System`."""


class CommandedAssembly(Assembly):
    """An assembly at an instant and under its control laws.

    `at` gives it on its orbit and with its tethers paid out; `measurements` is what laws may measure at a
    state; `commands` is what they command, and `with_commands` the assembly whose loads have it."""

    def at(self: Assembled, time: Instants, *motion: Coordinates) -> Assembled:
        """The system at one or several instants [s]: on its orbit, and with its tethers paid out. A system
        at an instant stays as it is. motion: as for `lengths`."""
        return at_place(self, self.place(time)).paid_out(time, *motion)

    def lengths(self, time: Instants, *motion: Coordinates) -> Deployed:
        """The deployed lengths at one or several instants [s], or (*state, 1). motion: q, v and vdot there;
        those that are left out are zero. They matter only where lengths are unknowns."""
        if isinstance(self.payout, ScheduledPayout):
            return self.payout.at(time)
        known = [x.reel for x in motion]
        return Deployed(*known, *(jnp.zeros_like(known[0]),) * (3 - len(known)))

    def paid_out(self: Assembled, time: Instants, *motion: Coordinates) -> Assembled:
        """The system with the tethers that are deployed at one or several instants [s], or (*state, 1).
        motion: as for `lengths`."""
        if self.payout is None or self.reels is not None:
            return self
        now = self.lengths(time, *motion)
        # Other terms replace energies within a step only.
        energies = tuple(term.at(time) for term in cast(tuple[Energy, ...], self.energies))
        reels = Reels.of(self.tethers, self.payout, now, energies, self.dissipations)
        return dataclasses.replace(
            self, tethers=deployed_tethers(self.tethers, self.payout, now), reels=reels
        )

    def in_segment(self: Assembled, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> Assembled:
        """The system between two switch times [s]: temperatures and rates of payout go on beyond them
        without a kink."""
        system = self.heated_in_segment(start, until)
        if system.payout is None:
            return system
        return dataclasses.replace(system, payout=system.payout.in_segment(start, until))

    def heated_in_segment(
        self: Assembled, start: Scalar | np.ndarray, until: Scalar | np.ndarray
    ) -> Assembled:
        """The system with the temperatures between two switch times [s]."""
        if not any(isinstance(term, ThermalEnergy) for term in self.energies):
            return self
        energies = tuple(
            term.in_segment(start, until) if isinstance(term, ThermalEnergy) else term
            for term in self.energies
        )
        return eqx.tree_at(lambda s: s.energies, self, energies)

    def with_events_until(self: Assembled, time: Scalar | np.ndarray) -> Assembled:
        """The system after all events up to `time`: roots that are released by then are free."""
        if self.roots is None or self.roots.releases.release_time is None:
            return self
        return eqx.tree_at(lambda s: s.roots.releases, self, self.roots.releases.with_events_until(time))

    def knots(self, time: Scalar, q: Coordinates, v: Coordinates) -> Float[Array, " knot"] | None:
        """Instants [s] at which a load changes its form in time, in any order, as foreseen from a state;
        None if there are none."""
        measured = self.measurements(time, q, v) if self.controlled else None
        instants = [x for load in self.loads for x in load.knots(measured)]
        others = (*self.tip_loads, *self.hub_loads, *self.fields, *self.winch_laws)
        instants += [x for term in others for x in term.knots]
        return jnp.concatenate([jnp.ravel(x) for x in instants]) if instants else None

    @property
    def controlled(self) -> bool:
        """Tells whether a control law has to be asked before forces can be evaluated."""
        return any(needs_command(load) for load in self.loads)

    def measurements(self, time: Scalar, q: Coordinates, v: Coordinates) -> Measurements:
        """What the control laws of the loads may measure at a state, without the wind."""
        if any(isinstance(load, ControlledLoad) and load.measures_motion for load in self.loads):
            return self.all_measurements(time, q, v)
        return self.directions(time, q, v)

    def all_measurements(self, time: Scalar, q: Coordinates, v: Coordinates) -> Measurements:
        """What laws of users may measure at a state, without the wind."""
        system = self.at(time, q, v)
        return with_motion(system, time, q, v, system.directions(time, q, v))

    def directions(self, time: Scalar, q: Coordinates, v: Coordinates) -> Measurements:
        """The measurements that are directions, and the position of a sail on an orbit."""
        axes, nodes = self.rotation(time, q), q.tether[0]
        chords = nodes[:, -1] - nodes[:, 0]
        chords = chords / jnp.linalg.norm(chords, axis=0)
        outward = axes @ self.roots.radial_directions
        measured = Measurements(
            time, axes[:, 0], outward, chords, spin_rate=angular_velocity(self, q, v)[0]
        )
        if self.hub is None:
            return measured
        momentum = self.angular_momentum(self.centred(q), v)
        measured = measured._replace(momentum_axis=momentum / jnp.sqrt(momentum @ momentum))
        if self.kepler_orbit is None:
            return measured
        return measured._replace(position=self.kepler_orbit.at(time)[0] + self.hub.centre(q.hub))

    def commands(self, time: Scalar, q: Coordinates, v: Coordinates) -> tuple[PerTether | None, ...]:
        """The command of every load's control law at a state; None for loads that need none."""
        measurements = self.measurements(time, q, v)
        return tuple(load.commanded(measurements) if needs_command(load) else None for load in self.loads)

    def with_commands(
        self: Assembled, commands: tuple[Float[Array, "*state tether"] | None, ...]
    ) -> Assembled:
        """The system whose loads have the given commands, as `commands` returns them."""
        loads = tuple(
            load.with_command(self.tethers.repeat_per_element(command))
            if isinstance(load, ControlledLoad) and command is not None
            else load
            for load, command in zip(self.loads, commands, strict=True)
        )
        return eqx.tree_at(lambda system: system.loads, self, loads)

    def holding(self: Assembled, volts: PerTether) -> Assembled:
        """The system whose sampled voltage law holds other voltages [V]."""
        held = tuple(
            tuple(term.holding(volts, self.tethers.elements) for term in part)
            for part in (self.loads, self.tip_loads, self.winch_laws)
        )
        return eqx.tree_at(lambda system: (system.loads, system.tip_loads, system.winch_laws), self, held)

    def with_added_strength(self: Assembled, added: dict[int, PerTether]) -> Assembled:
        """The system some of whose loads, by their places, are stronger than their law says [N/m]."""
        loads = tuple(
            load.with_added_strength(self.tethers.repeat_per_element(added[i]))
            if has_kinks(load) and i in added
            else load
            for i, load in enumerate(self.loads)
        )
        return eqx.tree_at(lambda system: system.loads, self, loads)

    def with_commanded_loads(self: Assembled, time: Scalar, q: Coordinates, v: Coordinates) -> Assembled:
        """The system whose loads have the commands of a state."""
        return self.with_commands(self.commands(time, q, v)) if self.controlled else self
