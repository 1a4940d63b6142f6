"""Builds the system of a scene and its initial state: tethers, hub, ring and roots, and the sum of what
acts. What a part of the scene brings, it names itself (`parts.py`).

`build` uses jax.numpy only, so that results have derivatives with respect to every number of the scene,
also through the steady start.
"""

from importlib import import_module
from typing import NamedTuple

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Nodal, PerTether, Rotation, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.elements.axial import AxialDissipation, AxialEnergy, TensionOnlyEnergy
from esail_jax.elements.bending import STRAIGHT_TURN, BendingDissipation, BendingEnergy
from esail_jax.elements.deployment import AbstractPayout, ExponentialPayout, RateTable
from esail_jax.elements.hinges import Hinges
from esail_jax.elements.rigid_body import Body, RigidBody, Spacecraft
from esail_jax.elements.ring import Ring
from esail_jax.elements.tether import TetherBatch, per_element
from esail_jax.elements.thermal import SteadyTemperature, ThermalEnergy
from esail_jax.elements.winch import Winches
from esail_jax.equilibria.steady_ring import hanging, steady_ring
from esail_jax.equilibria.steady_stretch import Line, along, steady_line, unstretched_line
from esail_jax.joints import roots as joints
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.law_structure import NUMBER
from esail_jax.loads.own_terms import Surroundings, fields_needed, own_terms
from esail_jax.numerics.lines_in_time import LinesInTime
from esail_jax.point_fields import PointFields
from esail_jax.rod_chain import RodChain, RodState
from esail_jax.scenes.build_parts import kepler_orbit_of, origin_of, starting_attitude
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.parts import SAIL, parts_of
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.system import System
from esail_jax.terms import Dissipation, Energy, Terms, find_term


class Model(NamedTuple):
    """A scene's system and its initial state q, v.

    unbalanced: largest force [N] of every tether that the steady start leaves unbalanced.
    """

    system: System
    q: Coordinates
    v: Coordinates
    unbalanced: PerTether


def build(structure: Structure, numbers: Numbers) -> Model:
    """System and initial state of a scene, given by its structure and numbers.

    The scene is a sail ([PGV] Sec. 4.1), or a chain, whose state is then that of its joints.
    """
    if structure.has("chain"):
        chain, state = build_chain(structure, numbers)
        q, v = chain.coordinates(state)
        return Model(chain.system, q, v, jnp.zeros(1))
    system = system_of(structure, numbers)
    q, v, unbalanced = initial_state(structure, numbers, system)
    return Model(system, q, v, unbalanced)


def hub_of(structure: Structure, numbers: Numbers) -> Body | None:
    """The hub: a cylinder, or a body with a mass and an inertia tensor."""
    if structure.has("hub.mass"):
        centre = numbers.get("hub.centre", jnp.zeros(3))
        return Spacecraft.of(numbers["hub.mass"], numbers["hub.inertia"], centre)
    if structure.has("hub"):
        return RigidBody(numbers["hub.height"], numbers["hub.radius"], numbers["hub.density"])
    return None


class RootPlaces(NamedTuple):
    """Places of the roots on the hub.

    azimuth: [rad] of the tethers about X_B from Y_B. radius: distances [m] from the axis, one of all or one
    each. positions: in B [m]; None where the radius says all."""

    azimuth: PerTether
    radius: Scalar | PerTether
    positions: Float[Array, "3 tether"] | None

    @property
    def outward(self) -> Float[Array, "3 tether"]:
        """Unit vectors from the spin axis through the roots, in B."""
        return joints.radial_directions(self.azimuth)

    @property
    def arms(self) -> Float[Array, "3 tether"]:
        """Positions in B [m]."""
        return self.radius * self.outward if self.positions is None else self.positions


def root_places(structure: Structure, numbers: Numbers) -> RootPlaces:
    """The places of the roots: those of `hub.roots`, or at the azimuths 2 pi i/p in the hub's mid-plane, at
    `hub.radius` from its axis; without a hub at the centre of a turning frame."""
    if structure.has("hub.roots"):
        positions = numbers["hub.roots"].T
        azimuth = joints.azimuths_of(positions)
        radius = (positions * joints.radial_directions(azimuth)).sum(0)
        return RootPlaces(azimuth, radius, positions)
    radius = numbers["hub.radius"] if structure.has("hub") else jnp.zeros(())
    return RootPlaces(joints.even_azimuths(structure["tethers.count"]), radius, None)


def system_of(structure: Structure, numbers: Numbers) -> System:
    """The system of a sail."""
    start, _ = starting_attitude(numbers)
    hub, acting = hub_of(structure, numbers), terms_of_parts(structure, numbers)
    tethers = tethers_of(structure, numbers, bool(acting.loads) or structure.has("deployment"))
    material = material_terms(structure, numbers)
    acting = material + acting + terms_of_user(structure, numbers, tethers, acting)
    return System(
        tethers=tethers,
        roots=roots_of(structure, numbers, hub, start),
        hub=hub,
        **vars(acting),
        ring=ring_of(structure, numbers) if structure.has("auxiliary_tethers") else None,
        kepler_orbit=kepler_orbit_of(numbers),
        parts=structure.parts,
        payout=payout_of(structure, numbers, numbers["tethers.length"]),
    )


def payout_of(structure: Structure, numbers: Numbers, total: PerTether) -> AbstractPayout | None:
    """How the tethers are paid out; None for those of constant length. total: lengths [m] in all; of a
    chain one."""
    if not structure.has("deployment"):
        return None

    def each(name: str) -> PerTether:
        return jnp.broadcast_to(numbers[f"deployment.{name}"], total.shape)

    def rows(name: str) -> Float[Array, "instant tether"]:
        given = numbers[f"deployment.{name}"]
        given = given if given.ndim == 2 else given[:, None]
        return jnp.broadcast_to(given, (given.shape[0], total.shape[0]))

    start, law = each("start_length"), structure["deployment.law"]
    if law == "exponential":
        return ExponentialPayout(total, start, each("growth"))
    if law == "table":
        return RateTable.undivided(total, start, numbers["deployment.time"], rows("rate"))
    tension = None
    if structure.has("deployment.tension"):
        tension = LinesInTime.undivided(numbers["deployment.time"], rows("tension"))
    return Winches(total, start, each("drum_mass"), tension)


def terms_of_parts(structure: Structure, numbers: Numbers) -> Terms:
    """What the parts of the scene bring, in the order of the parts (`Part.terms`)."""
    acting = Terms()
    for part in parts_of(structure.model).values():
        if part.terms and structure.has(part.name):
            module, _, function = part.terms.partition(":")
            acting += getattr(import_module(module), function)(structure, numbers)
    return acting


def terms_of_user(structure: Structure, numbers: Numbers, tethers: TetherBatch, acting: Terms) -> Terms:
    """The terms that a user added to the scene, and what they may know. acting: what the parts bring."""
    if not structure.own_terms:
        return Terms()
    orbit, thrust = kepler_orbit_of(numbers), None
    if structure.model == SAIL:
        thrust = find_term(acting.loads, CoulombThrust)
    first = None if orbit is None else (orbit.position, orbit.velocity)
    given = tuple(
        (term, tuple(numbers[f"{OWN_TERMS}.{i}.{j}"] for j in range(term.others.count(NUMBER))))
        for i, term in enumerate(structure.own_terms)
    )
    return own_terms(given, tethers, Surroundings(origin_of(numbers), orbit, first, thrust))


def material_terms(structure: Structure, numbers: Numbers) -> Terms:
    """Energies and dissipations of the tethers, for the keys that are given."""
    strain = structure["tethers.strain"]
    axial = numbers["tethers.youngs_modulus"] * numbers["tethers.area"]
    energies: list[Energy] = [AxialEnergy(axial, strain)]
    dissipations: list[Dissipation] = []
    if structure.has("tethers.axial_damping_time"):
        dissipations.append(AxialDissipation(axial, numbers["tethers.axial_damping_time"], strain))
    if structure["tethers.bending"]:
        bending = numbers["tethers.youngs_modulus"] * numbers["tethers.second_moment"]
        energies.append(BendingEnergy(bending))
        if structure.has("tethers.bending_damping_time"):
            straight = numbers.get("tethers.straight_turn", STRAIGHT_TURN) / numbers["tethers.length"]
            time = numbers["tethers.bending_damping_time"]
            dissipations.append(BendingDissipation(bending, time, straight))
    elements = structure["tethers.elements"]
    terms = jax.tree.map(lambda x: per_element(x, elements), (tuple(energies), tuple(dissipations)))
    if structure.has("thermal"):
        (axial_energy, *others), dissipations = terms
        terms = ((heated(structure, numbers, axial_energy), *others), dissipations)
    return Terms(*terms)


def heated(structure: Structure, numbers: Numbers, axial: AxialEnergy) -> ThermalEnergy:
    """The axial energy of tethers with the temperatures of [thermal]."""
    table, p = numbers["thermal.temperature"], structure["tethers.count"]
    temperature: SteadyTemperature | LinesInTime
    if structure.has("thermal.time"):
        time = numbers["thermal.time"]
        rows = jnp.broadcast_to(table if table.ndim == 2 else table[:, None], (time.shape[0], p))
        temperature = LinesInTime.undivided(time, rows)
    else:
        temperature = SteadyTemperature(jnp.broadcast_to(table, (p,)))
    return ThermalEnergy(
        stiffness=axial.stiffness,
        expansion=numbers["thermal.expansion"],
        reference=numbers["thermal.reference_temperature"],
        temperature=temperature,
        strain=axial.strain,
        elements=structure["tethers.elements"],
    )


def tethers_of(structure: Structure, numbers: Numbers, loaded: bool) -> TetherBatch:
    """The batch of tethers. It interpolates the fields that its terms need: r only if it is `loaded`."""
    elements = structure["tethers.elements"]
    length = numbers["tethers.length"]
    needed = fields_needed(structure.own_terms)
    if loaded:
        needed |= {"r"}
    if structure["tethers.bending"]:
        needed |= {"r_xx"}
    used = tuple(name for name in PointFields._fields if name == "r_x" or name in needed)
    mass = numbers.get("remote_units.mass", jnp.zeros_like(length))
    return TetherBatch(
        element_length=length / elements,
        line_density=numbers["tethers.density"] * numbers["tethers.area"],
        tip_mass=mass,
        elements=elements,
        kind=structure["tethers.element"],
        fields_used=used,
    )


def ring_of(structure: Structure, numbers: Numbers) -> Ring:
    """The ring of auxiliary tethers. Its strain is that of the tethers unless it has its own."""
    elements = structure["auxiliary_tethers.elements"]
    strain = structure["auxiliary_tethers.strain"] or structure["tethers.strain"]
    area = numbers["auxiliary_tethers.area"]
    axial = per_element(numbers["auxiliary_tethers.youngs_modulus"] * area, elements)
    energy: Energy = AxialEnergy(axial, strain)
    if structure.has("auxiliary_tethers.slack_strain"):
        width = per_element(numbers["auxiliary_tethers.slack_strain"], elements)
        energy = TensionOnlyEnergy(axial, width=width, strain=strain)
    dissipations: tuple[Dissipation, ...] = ()
    if structure.has("auxiliary_tethers.axial_damping_time"):
        time = per_element(numbers["auxiliary_tethers.axial_damping_time"], elements)
        dissipations = (AxialDissipation(axial, time, strain),)
    segments = TetherBatch(
        element_length=numbers["auxiliary_tethers.length"] / elements,
        line_density=area * numbers["auxiliary_tethers.density"],
        tip_mass=jnp.zeros_like(area),
        elements=elements,
        kind=structure["auxiliary_tethers.element"],
        fields_used=("r_x",),
    )
    return Ring(segments, (energy,), dissipations)


def roots_of(
    structure: Structure, numbers: Numbers, hub: Body | None, start: Rotation
) -> joints.HubRoots | joints.FrameRoots:
    """Spherical or clamped roots at their places."""
    places = root_places(structure, numbers)
    clamped = structure["tethers.root"] == "clamped"
    normals = joints.clamp_normals(places.azimuth) if clamped else None
    releases = joints.Releases(numbers.get("event.time")).with_events_until(jnp.zeros(()))
    if hub is None:
        spin = numbers["initial.spin_rate"]
        return joints.FrameRoots(start, spin, 0.0 * places.outward, normals, releases)
    if normals is not None:
        normals = jnp.moveaxis(hub.direction_weights(jnp.moveaxis(normals, 1, 0)), 0, 1)
    azimuth = None if places.positions is None else places.azimuth
    return joints.HubRoots(hub.weights(places.arms), normals, releases, azimuth)


def initial_state(
    structure: Structure, numbers: Numbers, system: System
) -> tuple[Coordinates, Coordinates, PerTether]:
    """Initial positions and velocities: straight tethers on their cone that turn rigidly with the hub. Also
    the largest force [N] of every tether that the steady elongation leaves unbalanced."""
    (start, _), places = starting_attitude(numbers), root_places(structure, numbers)
    coning = jnp.deg2rad(numbers["initial.coning_angle_deg"])
    radius, outward = places.radius, places.outward
    spin = numbers["initial.spin_rate"]
    if structure["initial.elongation"] == "paper":
        line, unbalanced = printed_line(numbers, system.tethers, radius), jnp.zeros_like(places.azimuth)
    elif system.payout is None:
        line, unbalanced = steady_line(system.tethers, system.energies, radius, spin, coning)
    else:
        line, unbalanced = steady_line(
            deployed_part(numbers, system), system.energies, radius, spin, coning
        )
        share = system.payout.at_start().length / system.payout.total
        line = line.at[1:].multiply(share)  # slopes by x in place of s
    x_axis = jnp.array([[1.0], [0.0], [0.0]])
    direction = jnp.cos(coning) * outward + jnp.sin(coning) * x_axis
    body = along(line, direction)
    body = body.at[0].add(places.arms[:, None])
    ring = None
    if system.ring is not None and structure["initial.elongation"] == "paper":
        ring = hanging(system.ring, body[0, :, -1])
    elif system.ring is not None:
        alone = unbalanced
        body, ring, unbalanced = steady_ring(system, body, outward, radius, spin, coning)
        unbalanced = jnp.where(jnp.isinf(alone), alone, unbalanced)
    tether = jnp.einsum("ib,kbnt->kint", start, body)
    ring = None if ring is None else jnp.einsum("ib,bnt->int", start, ring)
    omega = joints.spin_vector(start, spin)

    def turned(vectors, axis):
        return jnp.cross(omega, vectors, axisb=axis, axisc=axis)

    hub = hub_velocity = None
    if system.hub is not None:
        hub = system.hub.base_points @ start.T
        hub_velocity = turned(hub, 1)
    ring_velocity = None if ring is None else turned(ring, 0)
    reel = reel_rate = None
    if system.has_unknown_lengths:
        reel, reel_rate, _ = system.payout.at_start()
    q = Coordinates(tether, hub, ring, reel)
    v = Coordinates(turned(tether, 1), hub_velocity, ring_velocity, reel_rate)
    zero = jnp.zeros(())
    if system.payout is not None:
        v = v._replace(tether=v.tether + rate_of_payout(system, q.tether))
    return system.place_roots(zero, q), system.place_roots(zero, v, derivative=1), unbalanced


def deployed_part(numbers: Numbers, system: System) -> TetherBatch:
    """The tethers that are deployed at the start, as tethers of this length."""
    batch = system.tethers
    return TetherBatch(
        element_length=numbers["deployment.start_length"] / batch.elements,
        line_density=batch.line_density,
        tip_mass=batch.tip_mass,
        elements=batch.elements,
        kind=batch.kind,
        fields_used=batch.fields_used,
    )


def rate_of_payout(system: System, tether: Nodal) -> Nodal:
    """The rates of the nodes of a straight tether whose material has the velocity l' r_s beside that of the
    hub: l' xi r_s of positions, and c r_x of slopes."""
    now = system.payout.at_start()
    relative = now.rate / now.length
    along = tether[0] - tether[0, :, :1]
    return jnp.concatenate([(relative * along)[None], relative * tether[1:]])


def printed_line(numbers: Numbers, tethers: TetherBatch, radius: Array) -> Line:
    """The initial elongation of [PGV] Eq. 79-80 as printed.

    It is that of a rotating cable whose tip mass is the tether's own mass m_t, stretched from the axis
    rather than from the root. `place_roots` then puts the root on the hub; the errata describe the
    consequences.
    """
    modulus, spin_squared = numbers["tethers.youngs_modulus"], numbers["initial.spin_rate"] ** 2
    length, density = numbers["tethers.length"], numbers["tethers.density"]
    tether_mass = tethers.line_density * length
    tip = tether_mass * spin_squared * length / (modulus * numbers["tethers.area"])
    r = radius + unstretched_line(tethers)[0]
    position = (1.0 + density * spin_squared / (6.0 * modulus) * (3.0 * length**2 - r**2) + tip) * r
    slope = 1.0 + density * spin_squared / (2.0 * modulus) * (length**2 - r**2) + tip
    return jnp.stack([position - radius, slope][: tethers.coefs])


def build_chain(structure: Structure, numbers: Numbers) -> tuple[RodChain, RodState]:
    """A chain of rods and its initial state ([MW] Sec. 3)."""
    column = {key: x[:, None] for key, x in numbers.items() if key.startswith("chain.") and x.ndim}
    length, free = column["chain.length"], structure["chain.anchor"] == "free"
    rods = structure["chain.rods"]
    axial = per_element(column["chain.youngs_modulus"] * column["chain.area"], rods)
    strain = structure["chain.strain"]
    energy: Energy = AxialEnergy(axial, strain)
    if structure.has("chain.slack_strain"):
        energy = TensionOnlyEnergy(axial, width=numbers["chain.slack_strain"], strain=strain)
    dissipations: tuple[Dissipation, ...] = ()
    if structure.has("chain.axial_damping_time"):
        time = per_element(column["chain.axial_damping_time"], rods)
        dissipations = (AxialDissipation(axial, time, strain),)
    acting = terms_of_parts(structure, numbers)
    pushed = bool(acting.loads) or structure.has("deployment") or "r" in fields_needed(structure.own_terms)
    tethers = TetherBatch(
        element_length=length,
        line_density=column["chain.mass"] / length,
        tip_mass=numbers["chain.tip_mass"][None],
        elements=rods,
        kind="rod",
        fields_used=("r",) * pushed + ("r_x",),
        base_mass=numbers.get("chain.base_mass", jnp.zeros(()))[None] if free else None,
    )
    held = joints.FrameRoots(jnp.eye(3), jnp.zeros(()), jnp.zeros((3, 1)), None)
    acting = Terms((energy,), dissipations) + acting + terms_of_user(structure, numbers, tethers, acting)
    system = System(
        tethers,
        None if free else held,
        None,
        **vars(acting),
        parts=structure.parts,
        payout=payout_of(structure, numbers, length.sum(0)),
    )
    x, v = numbers["initial.rod_vector"].T, numbers["initial.rod_rate"].T
    hinges = None
    if structure["chain.bending"]:
        bending = numbers["chain.youngs_modulus"] * numbers["chain.second_moment"]
        clamped = structure["chain.root"] == "clamped"
        direction = x[:, 0] / jnp.linalg.norm(x[:, 0]) if clamped else None
        hinges = Hinges.of(bending, numbers["chain.length"], direction)
    if free:
        first = (numbers.get(f"initial.{key}", jnp.zeros(3))[:, None] for key in ("position", "velocity"))
        x, v = (jnp.concatenate(pair, axis=1) for pair in zip(first, (x, v), strict=True))
    chain = RodChain.of(system, hinges)
    return chain, RodState(x, v, system.no_power if chain.has_work else None)
