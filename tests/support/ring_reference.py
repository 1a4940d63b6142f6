"""An independent simulator of a sail with auxiliary tethers, or on an orbit, in NumPy and SciPy alone.

The module shares no code with the package. Unknowns are the hub's centre, its attitude as a unit
quaternion, and all nodal vectors but the roots, which are eliminated from one dense mass matrix; there are
no constraints and no structured solver. Time integration is explicit (Dormand & Prince 8(5,3)).

On an orbit, all positions are heliocentric, less a uniform motion with the velocity at the start: the axes
are inertial. Every mass, and a particle beside the sail in place of the package's closed form, is attracted
by the Sun by itself.
"""

from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp

AU, SPEED, DENSITY, CUTOFF = 1.495978707e11, 4e5, 7.3e6, 1e3
SUN = 1.32712440018e20
WIND_FACTOR = 0.18 * np.sqrt(8.854e-12 * 1.67e-27 * DENSITY)


def shapes(kind, length):
    """Gauss weights on an element, shape functions and their derivatives by x at the Gauss points."""
    gauss, weights = np.polynomial.legendre.leggauss({"truss": 2, "cable": 5}[kind])
    x = 0.5 * (gauss + 1.0)
    if kind == "truss":
        s, d = np.stack([1 - x, x], 1), np.stack([-np.ones_like(x), np.ones_like(x)], 1) / length
    else:
        s = [1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3)]
        s = np.stack([*s, 3 * x**2 - 2 * x**3, length * (x**3 - x**2)], 1)
        d = [(6 * x**2 - 6 * x) / length, 1 - 4 * x + 3 * x**2]
        d = np.stack([*d, (6 * x - 6 * x**2) / length, 3 * x**2 - 2 * x], 1)
    return 0.5 * weights * length, s, d


class Sail:
    """A sail. tethers, ring: mappings with `kind, elements, length, area, density, modulus, damping`, each
    number an array with one entry per member; `slack` of the ring is the width of the tension-only law or
    None; ring is None without one. mass, voltage: arrays. hub: (height, radius, density) of a cylinder, or
    a mapping `mass, inertia, centre, roots`: the tensor about the centre of mass, and positions from the
    hub centre in B. The state holds the centre of mass. strain: of
    tethers and ring. natural: None, or (time, table): the strain of free thermal expansion of the tethers
    at increasing instants, (instant, tether). orbit: heliocentric position [m], velocity [m/s] and the
    distance [m] at which the wind's density is given, or None. relative: whether the wind is felt relative
    to each point."""

    def __init__(
        self,
        tethers,
        ring,
        mass,
        voltage,
        hub,
        spin,
        alpha,
        strain,
        natural=None,
        orbit=None,
        relative=False,
    ):
        self.p, self.spin, self.alpha, self.strain = len(mass), spin, alpha, strain
        self.natural = natural
        angle = 2 * np.pi * np.arange(self.p) / self.p
        if isinstance(hub, dict):
            self.hub_mass, self.inertia = hub["mass"], np.array(hub["inertia"])
            self.offset, self.arms = np.array(hub["centre"]), np.array(hub["roots"])
            angle = np.arctan2(self.arms[:, 2], self.arms[:, 1])
        else:
            height, radius, density = hub
            self.hub_mass = density * np.pi * radius**2 * height
            cross = (3 * radius**2 + height**2) / 12
            self.inertia = self.hub_mass * np.diag([radius**2 / 2, cross, cross])
            self.offset = np.zeros(3)
            self.arms = radius * np.stack([0 * angle, np.cos(angle), np.sin(angle)], 1)
        self.outward = np.stack([0 * angle, np.cos(angle), np.sin(angle)], 1)
        self.count = 0
        chains = [
            self.new_chain(tethers["kind"], tethers["elements"], 0, None, None) for _ in range(self.p)
        ]
        self.roots, self.tips = (np.array([chain[k][0] for chain in chains]) for k in (0, -1))
        after = np.roll(self.tips, -1)
        ends = zip(self.tips, after, strict=True)
        segments = []
        if ring is not None:
            segments = [self.new_chain(ring["kind"], ring["elements"], 1, *pair) for pair in ends]
        self.chains, self.segments = chains, segments
        self.mass = np.zeros((self.count, self.count))
        self.mass[self.tips, self.tips] += mass
        push = WIND_FACTOR * np.maximum(0.0, voltage - CUTOFF)
        self.groups = [self.group(tethers, chains, push)]
        if ring is not None:
            self.groups.append(self.group(ring, segments, 0.0 * push))
        for group in self.groups:
            group.heated = natural is not None and group is self.groups[0]
        self.free = np.setdiff1d(np.arange(self.count), self.roots)
        self.origin = AU * np.array([0.7071067811865476, 0.7071067811865476, 0.0])
        self.tips_mass, self.moving, self.relative = mass, orbit is not None, relative
        self.drift, self.reference = np.zeros(3), None
        if orbit is not None:
            self.origin, self.drift, self.reference = orbit

    def new_chain(self, kind, elements, skip, first, last):
        """Numbers of the vectors of every node, new ones except for given ends."""
        nodes = []
        for k in range(elements + 1):
            given = first if k == 0 else last if k == elements else None
            own = [] if given is None else [given]
            while len(own) < (1 if kind == "truss" else 2):
                own.append(self.count)
                self.count += 1
            nodes.append(own)
        return nodes

    def group(self, table, chains, push):
        """The elements of all chains; also adds their mass."""
        rows = {
            name: []
            for name in ("index", "weight", "s", "d", "axial", "damping", "slack", "push", "l", "line")
        }
        for i, nodes in enumerate(chains):
            length = table["length"][i] / table["elements"]
            weight, s, d = shapes(table["kind"], length)
            gauss, full = np.polynomial.legendre.leggauss(4)
            exact = self.exact_mass(table["kind"], length, 0.5 * (gauss + 1), 0.5 * full * length)
            for k in range(table["elements"]):
                index = np.array(nodes[k] + nodes[k + 1])
                self.mass[np.ix_(index, index)] += table["density"][i] * table["area"][i] * exact
                slack = np.nan if table.get("slack") is None else table["slack"][i]
                axial = table["modulus"][i] * table["area"][i]
                line = table["density"][i] * table["area"][i]
                new = (index, weight, s, d, axial, table["damping"][i], slack, push[i], i, line)
                for name, value in zip(rows, new, strict=True):
                    rows[name].append(value)
        found = SimpleNamespace(**{name: np.array(value) for name, value in rows.items()})
        found.gather = np.zeros((self.count, found.index.size))
        found.gather[found.index.reshape(-1), np.arange(found.index.size)] = 1.0
        return found

    @staticmethod
    def exact_mass(kind, length, x, weight):
        if kind == "truss":
            s = np.stack([1 - x, x], 1)
        else:
            s = [1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3)]
            s = np.stack([*s, 3 * x**2 - 2 * x**3, length * (x**3 - x**2)], 1)
        return np.einsum("g,ga,gb->ab", weight, s, s)

    # ---- forces ----------------------------------------------------------------------------------

    def heat(self, group, time):
        """Natural strain of every element and its rate at an instant."""
        if not group.heated:
            return np.zeros((2, len(group.l), 1))
        knots, table = self.natural
        place = np.searchsorted(knots, time, side="right")
        if place in (0, len(knots)):
            found = table[min(place, len(knots) - 1)]
            return np.stack([found, 0 * found])[:, group.l, None]
        rate = (table[place] - table[place - 1]) / (knots[place] - knots[place - 1])
        found = table[place - 1] + (time - knots[place - 1]) * rate
        return np.stack([found, rate])[:, group.l, None]

    def stress(self, group, strain):
        """Energy per length and force W'(strain)."""
        e, axial = strain, group.axial[:, None]
        if np.isnan(group.slack).all():
            return 0.5 * axial * e**2, axial * e
        w = group.slack[:, None]
        x = np.clip((e + w / 2) / w, 0.0, 1.0)
        above = np.maximum(e - w / 2, 0.0)
        energy = axial * (w**2 * x**3 / 6 + np.where(x < 1, 0.0, above * w / 2 + above**2 / 2))
        return energy, axial * (w * x**2 / 2 + above)

    def members(self, group, q, v, time=0.0):
        """Forces on the vectors, elastic energy, dissipated power, thrust and axial force at the points,
        and the power of thrust and heating."""
        at, rate = q[group.index], v[group.index]
        slope, turned = (np.einsum("egk,ekx->egx", group.d, a) for a in (at, rate))
        square = (slope**2).sum(-1)
        stretch = np.sqrt(square)
        along = (slope * turned).sum(-1)
        if self.strain == "green-lagrange":
            strain, strain_rate, scale = 0.5 * (square - 1), along, 1.0
        else:
            strain, strain_rate, scale = stretch - 1, along / stretch, 1 / stretch
        natural, natural_rate = self.heat(group, time)
        energy, elastic = self.stress(group, strain - natural)
        force = (elastic + group.axial[:, None] * group.damping[:, None] * strain_rate) * scale
        nodal = -np.einsum("eg,egk,eg,egx->ekx", group.weight, group.d, force, slope)
        place = self.origin + self.drift * time + np.einsum("egk,ekx->egx", group.s, at)
        distance = np.linalg.norm(place, axis=-1, keepdims=True)
        wind = SPEED * place / distance
        if self.relative:
            wind = wind - self.drift - np.einsum("egk,ekx->egx", group.s, rate)
        normal = wind - ((slope * wind).sum(-1) / square)[..., None] * slope
        thrust = group.push[:, None, None] * normal
        if self.moving:
            # The thrust grows with the root of the density, which falls with the square of the distance.
            thrust = thrust * self.reference / distance
            weight = -SUN * group.line[:, None, None] * place / distance**3
            nodal = nodal + np.einsum("eg,egk,egx->ekx", group.weight, group.s, weight)
        nodal = nodal + np.einsum("eg,egk,egx->ekx", group.weight, group.s, thrust)
        moving = np.einsum("egk,ekx->egx", group.s, rate)
        power = (thrust * moving).sum(-1) - elastic * natural_rate
        lost = group.weight * group.axial[:, None] * group.damping[:, None] * strain_rate**2
        return SimpleNamespace(
            nodal=group.gather @ nodal.reshape(-1, 3),
            energy=(group.weight * energy).sum(),
            power=(group.weight * power).sum(),
            dissipated=lost.sum(),
            thrust=np.einsum("eg,egx->x", group.weight, thrust),
            axial=(group.weight * force * stretch).sum(1) / group.weight.sum(1),
            length=(group.weight * stretch).sum(1),
        )

    def all_vectors(self, y):
        """Attitude, hub's centre and rates, and all vectors with their rates from a state."""
        centre, quaternion, velocity, omega = y[:3], y[3:7], y[7:10], y[10:13]
        q, v = y[13 : 13 + 6 * len(self.free)].reshape(2, -1, 3)
        a, b, c, d = quaternion / np.linalg.norm(quaternion)
        turn = np.array([
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ])  # fmt: skip
        arms, spin = (self.arms - self.offset) @ turn.T, turn @ omega
        full, rate = np.zeros((self.count, 3)), np.zeros((self.count, 3))
        full[self.free], rate[self.free] = q, v
        full[self.roots], rate[self.roots] = centre + arms, velocity + np.cross(spin, arms)
        return turn, arms, spin, full, rate

    def attracted(self, time, x):
        """Acceleration by the Sun at positions (..., 3)."""
        place = self.origin + self.drift * time + x
        return -SUN * place / np.linalg.norm(place, axis=-1, keepdims=True) ** 3

    def derivative(self, time, y):
        """dy/dt."""
        turn, arms, spin, q, v = self.all_vectors(y)
        load = sum(self.members(group, q, v, time).nodal for group in self.groups)
        if self.moving:
            load[self.tips] += self.tips_mass[:, None] * self.attracted(time, q[self.tips])
        # The roots' accelerations are T u + bias, u = (hub's acceleration, angular acceleration).
        bias = np.cross(spin, np.cross(spin, arms))
        rows = np.zeros((self.p, 3, 6))
        rows[:, :, :3] = np.eye(3)
        for k in range(3):
            rows[:, :, 3 + k] = np.cross(np.eye(3)[k], arms)
        free, roots = self.free, self.roots
        inner = self.mass[np.ix_(free, free)]
        across = self.mass[np.ix_(free, roots)]
        alone = np.linalg.solve(inner, load[free] - across @ bias)
        follow = np.linalg.solve(inner, across)
        own = self.mass[np.ix_(roots, roots)] - across.T @ follow
        force = load[roots] - across.T @ alone - self.mass[np.ix_(roots, roots)] @ bias
        matrix = np.einsum("ika,ij,jkb->ab", rows, own, rows)
        matrix[:3, :3] += self.hub_mass * np.eye(3)
        matrix[3:, 3:] += turn @ self.inertia @ turn.T
        right = np.einsum("ika,ik->a", rows, force)
        omega = y[10:13]
        right[3:] -= turn @ np.cross(omega, self.inertia @ omega)
        tail = []
        if self.moving:
            place = self.origin + self.drift * time + y[:3]
            size = np.linalg.norm(place)
            along = turn.T @ place / size
            right[:3] += self.hub_mass * self.attracted(time, y[:3])
            right[3:] += 3.0 * SUN / size**3 * turn @ np.cross(along, self.inertia @ along)
            tail = [y[-3:], self.attracted(time, y[-6:-3])]
        u = np.linalg.solve(matrix, right)
        root = np.einsum("ika,a->ik", rows, u)
        inside = alone - follow @ root
        a, (b, c, d) = y[3], y[4:7]
        x, s, z = omega
        quaternion = 0.5 * np.array(
            [-b * x - c * s - d * z, a * x + c * z - d * s, a * s + d * x - b * z, a * z + b * s - c * x]
        )
        rate = turn.T @ u[3:]
        inner = [v[free].reshape(-1), inside.reshape(-1)]
        return np.concatenate([y[7:10], quaternion, u[:3], rate, *inner, *tail])

    # ---- start and run ------------------------------------------------------------------------------

    def start(self):
        """The steady shape, by Newton's method with differences, in the spin plane; then the attitude."""
        q = np.zeros((self.count, 3))
        spans = self.spans(self.groups[0], len(self.chains[0]) - 1)
        for chain, arm, out, (weight, length) in zip(
            self.chains, self.arms, self.outward, spans, strict=True
        ):
            del weight
            for k, node in enumerate(chain):
                q[node[0]] = arm + k * length * out
                q[node[1:]] = out
        spans = self.spans(self.groups[1], len(self.segments[0]) - 1) if self.segments else []
        for nodes, (_, length) in zip(self.segments, spans, strict=True):
            n = len(nodes) - 1
            first, last = q[nodes[0][0]], q[nodes[-1][0]]
            middle = first + last
            bow = 0.02 * n * length * middle / np.linalg.norm(middle) * (n * length > 1.0)
            for k, node in enumerate(nodes):
                x = k / n
                if 0 < k < n:
                    q[node[0]] = first + x * (last - first) + 4 * x * (1 - x) * bow
                for slope in node[1:]:
                    q[slope] = (last - first + 4 * (1 - 2 * x) * bow) / (n * length)
        free, still = self.free, np.zeros_like(q)
        plane = np.diag([0.0, 1.0, 1.0])

        def left(flat):
            q[free, 1:] = flat.reshape(-1, 2)
            # The stiffness does not see the wind: it is switched off by a zero push.
            load = sum(self.members(group, q, still, 0.0).nodal for group in calm)
            return (load + self.spin**2 * self.mass @ q @ plane)[free, 1:].reshape(-1)

        off = ("push", "line")
        calm = [
            SimpleNamespace(**(vars(group) | {name: 0 * vars(group)[name] for name in off}))
            for group in self.groups
        ]
        x = q[free, 1:].reshape(-1).copy()
        size = np.maximum(np.abs(x).max() * 1e-7, 1e-7)
        slopes = np.ones(self.count, bool)
        slopes[[node[0] for chain in (*self.chains, *self.segments) for node in chain]] = False
        steps = np.where(np.repeat(slopes[free], 2), 1e-7, size)
        for attempt in range(80):
            matrix = np.stack([(left(x + h * e) - left(x - h * e)) / (2 * h)
                               for h, e in zip(steps, np.eye(len(x)), strict=True)], 1)  # fmt: skip
            step = -np.linalg.solve(matrix, left(x))
            largest = np.abs(step[~np.repeat(slopes[free], 2)]).max()
            x = x + step * min(1.0, 100.0 / largest)
            if largest < 1e-9 and attempt > 2:
                break
        left(x)
        k = self.origin / np.linalg.norm(self.origin)
        i = np.cross([0.0, 0.0, 1.0], k)
        i /= np.linalg.norm(i)
        angle = self.alpha - np.pi / 2
        c, s = np.cos(angle), np.sin(angle)
        turn = np.stack([i, np.cross(k, i), k], 1) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        q = q @ turn.T
        v = np.cross(turn[:, 0] * self.spin, q)
        w = np.sqrt(max(0.0, 1 + np.trace(turn))) / 2
        skew = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        quaternion = np.concatenate([[w], skew / (4 * w)])
        centre = turn @ self.offset
        moving = np.cross(turn[:, 0] * self.spin, centre)
        rest = np.concatenate([centre, quaternion, moving, [self.spin, 0.0, 0.0]])
        tail = np.zeros(6 if self.moving else 0)
        return np.concatenate([rest, q[free].reshape(-1), v[free].reshape(-1), tail])

    @staticmethod
    def spans(group, elements):
        """Of every chain a number and the length of an element."""
        return [(i, group.weight[group.l == i][0].sum()) for i in range(group.l.max() + 1)]

    def signals(self, time, y):
        """Signals of a state, by the names of the observables."""
        turn, _, _, q, v = self.all_vectors(y)
        found = [self.members(group, q, v, time) for group in self.groups]
        beside, moving = (y[-6:-3], y[-3:]) if self.moving else (np.zeros(3), np.zeros(3))
        hub = y[7:10] - moving
        # Slopes have no part of a uniform velocity.
        v = v.copy()
        v[[node[0] for chain in (*self.chains, *self.segments) for node in chain]] -= moving
        kinetic = 0.5 * np.einsum("ax,ab,bx->", v, self.mass, v)
        kinetic += 0.5 * self.hub_mass * hub @ hub + 0.5 * (self.inertia @ y[10:13]) @ y[10:13]
        per = [group.l for group in self.groups]
        signals = {
            "tip_position_I": q[self.tips] - beside,
            "hub_position_I": y[:3] - turn @ self.offset - beside,
            "rotation_IB": turn,
            "angular_velocity_B": y[10:13],
            "tether_length": np.bincount(per[0], found[0].length),
            "kinetic_energy": kinetic,
            "elastic_energy": sum(x.energy for x in found),
            "dissipated_power": sum(x.dissipated for x in found),
        }
        if self.segments:
            signals["auxiliary_tension"] = np.bincount(per[1], found[1].axial) / (per[1] == 0).sum()
        if not self.moving:
            signals["external_power"] = sum(x.power for x in found)
        if self.moving:
            signals["heliocentric_position"] = self.origin + self.drift * time + y[:3] - turn @ self.offset
            signals["heliocentric_velocity"] = self.drift + y[7:10]
        return signals

    def run(self, times, tolerance=1e-13):
        """Signals at the given times, by name, time first. With a tenfold tolerance and hundredfold scales
        the dissipated power of a sail of cables, which is small, has errors of 2e-6 of its range."""
        y = self.start()
        scale = np.full(y.size, 1e-11)
        scale[3:7] = scale[10:13] = 1e-15
        knots = [] if self.natural is None else [t for t in self.natural[0] if 0.0 < t < times[-1]]
        rows, start = [], 0.0
        for end in (*knots, times[-1]):
            # Each part of the run ends where the rate of the temperature jumps.
            inside = times[(times >= start) & ((times < end) | (end == times[-1]))]
            settings = {"method": "DOP853", "rtol": tolerance, "atol": scale}
            saved = np.union1d(inside, [end])
            found = solve_ivp(self.derivative, (start, end), y, t_eval=saved, **settings)
            rows += [self.signals(*x) for x in zip(inside, found.y.T[: len(inside)], strict=True)]
            start, y = end, found.y[:, -1]
        return {name: np.stack([row[name] for row in rows]) for name in rows[0]}
