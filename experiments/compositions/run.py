"""Compares compositions of transformations of JAX with difference quotients, for every method.

python experiments/compositions/run.py [--resume] [METHOD ...]     # writes compositions.csv

With --resume, rows that the table has already are not computed again.

A function g of one number becomes another one: by its derivative in forward mode (`jvp`) or reverse mode
(`grad`), by the mean over two members, g(x) and g(1.1 x) (`vmap`, `map`, `scan`, and `shard_map` over the
devices), or stays what it is (`jit`, `checkpoint`). All pairs of these are applied to a run, and the
triples that people use.
"""

import csv
import itertools
import sys
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

import esail_jax as esail
from esail_jax.compilation.remembered import mappings

MOST_MAPPINGS = 25_000
"""Number of memory mappings of the process beyond which JAX, too, forgets its programs. Linux allows
65,530, and one row of the table needs up to ten thousand."""

SAIL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "integrator.t_end": 20.0,
    "output.interval": 10.0,
}  # fmt: skip

CHAIN = {"chain.rods": 3, "integrator.t_end": 0.2, "output.interval": 0.1}
"""A short chain of rods under gravity."""

METHODS = {
    "collocation": ("baseline", SAIL | {"integrator.tolerance": 1e-12}),
    "generalized-alpha": (
        "baseline",
        SAIL | {"integrator.method": "generalized-alpha", "integrator.step": 1.0},
    ),
    "energy-momentum": (
        "baseline",
        SAIL | {"integrator.method": "energy-momentum", "integrator.step": 1.0},
    ),
    "chain": ("hanging-chain", CHAIN),
}
"""Scene and overrides of every method. Runs with fixed steps are smooth; those of collocation need a small
tolerance, because the steps of neighbouring runs differ."""

AT = 4e-3
"""The spin rate [rad/s] at which all functions are evaluated."""

MEMBERS = (1.0, 1.1)
"""Factors of the argument in the mean over two members."""

SIZE = 1e-2
"""Largest relative change of the argument in a difference quotient of sixth order."""


def outcome(method: str) -> Callable:
    """The last coning angle of a tether as a function of the spin rate; for a chain the last place
    of its end along the swing [m] as a function of the same number, as a part of gravity."""
    scene, overrides = METHODS[method]

    def f(spin):
        return esail.simulate(scene, overrides | {"initial.spin_rate": spin})["coning_angle"][-1, 0]

    def g(part):
        gravity = jnp.stack([0.0, -9.81 * part / AT, 0.0])
        run = esail.simulate(scene, overrides | {"gravity.acceleration": gravity})
        return run["joint_position"][-1, -1, 0]

    return g if method == "chain" else f


# ---- transformations ----------------------------------------------------------------------------


def over_members(apply: Callable) -> Callable:
    """The transformation into the mean over two members. apply: computes all of them."""
    return lambda g: lambda x: apply(g, jnp.asarray(MEMBERS) * x).mean()


def sharded(g: Callable, members: jax.Array) -> jax.Array:
    """The members' results, whose arguments are divided among the devices."""
    mesh, part = Mesh(np.array(jax.devices()[: len(MEMBERS)]), ("member",)), PartitionSpec("member")
    return jax.shard_map(
        lambda some: lax.map(g, some), mesh=mesh, in_specs=part, out_specs=part, check_vma=False
    )(members)


MEANS = {
    "vmap": over_members(lambda g, members: jax.vmap(g)(members)),
    "map": over_members(lax.map),
    "scan": over_members(lambda g, members: lax.scan(lambda _, x: (None, g(x)), None, members)[1]),
    "shard_map": over_members(sharded),
}
DERIVATIVES = {
    "jvp": lambda g: lambda x: jax.jvp(g, (x,), (jnp.ones_like(x),))[1],
    "grad": jax.grad,
}
UNCHANGED = {"jit": jax.jit, "checkpoint": jax.checkpoint}
TRANSFORMATIONS = DERIVATIVES | MEANS | UNCHANGED
TRIPLES = (
    ("vmap", "jvp", "grad"), ("grad", "vmap", "jvp"), ("jvp", "vmap", "grad"), ("grad", "vmap", "grad"),
    ("jvp", "jvp", "grad"), ("jit", "jvp", "grad"), ("jit", "vmap", "grad"),
)  # fmt: skip
"""Compositions of three: batches of Hessians, derivatives of batches of derivatives, third derivatives."""


PAIRS = [pair for pair in itertools.product(TRANSFORMATIONS, repeat=2) if pair != ("shard_map",) * 2]
"""All pairs, but for `shard_map` of `shard_map`: JAX does not divide the devices of one mesh twice."""


def composed(names: tuple[str, ...], f: Callable) -> Callable:
    """The composition, the outermost transformation first."""
    for name in reversed(names):
        f = TRANSFORMATIONS[name](f)
    return f


# ---- references ---------------------------------------------------------------------------------


def terms_of(names: tuple[str, ...]) -> list[tuple[float, float, int]]:
    """A composition as a sum: (k, c, n) stands for k times the n-th derivative of f at c x."""
    terms = [(1.0, 1.0, 0)]
    for name in reversed(names):
        if name in DERIVATIVES:
            terms = [(k * c, c, n + 1) for k, c, n in terms]
        elif name in MEANS:
            terms = [(k / len(MEMBERS), c * m, n) for k, c, n in terms for m in MEMBERS]
    return terms


def quotient(f: Callable, x: float) -> float:
    """The derivative of a function by a difference quotient of sixth order."""
    h = SIZE * x / 3.0
    y = [float(f(x + k * h)) for k in (-3, -2, -1, 1, 2, 3)]
    return float(np.dot([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0], y) / (60.0 * h))


class References:
    """Derivatives of a function by difference quotients: the first one of the function, the next ones of
    the derivative of one order less."""

    def __init__(self, f: Callable):
        self._orders = [jax.jit(f)]
        for _ in range(2):
            f = jax.jacfwd(f)
            self._orders.append(esail.jit(f))
        self._found: dict[tuple[float, int], float] = {}

    def __call__(self, x: float, order: int) -> float:
        if (x, order) not in self._found:
            exact = float(self._orders[0](x)) if order == 0 else quotient(self._orders[order - 1], x)
            self._found[x, order] = exact
        return self._found[x, order]


HEADS = "method", "composition", "order", "found", "quotient", "difference", "first_call_s"


def rows_of(path: Path) -> list[list[str]]:
    """The rows of the table."""
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))[1:]


def main() -> None:
    jax.config.update("jax_num_cpu_devices", len(MEMBERS))  # for shard_map
    chosen = [x for x in sys.argv[1:] if x != "--resume"]
    path, methods = Path(__file__).with_name("compositions.csv"), chosen or list(METHODS)
    rows = [row for row in rows_of(path) if "--resume" in sys.argv or row[0] not in methods]
    known = {(row[0], row[1]) for row in rows}
    for method in methods:
        f = outcome(method)
        references = References(f)
        for names in (*PAIRS, *TRIPLES):
            if (method, " ".join(names)) in known:
                continue
            if mappings() > MOST_MAPPINGS:
                esail.clear_caches()
                jax.clear_caches()
            began = time.perf_counter()
            found = float(composed(names, f)(AT))
            seconds = time.perf_counter() - began
            terms = terms_of(names)
            expected = sum(k * references(c * AT, n) for k, c, n in terms)
            order = max(n for *_, n in terms)
            rows.append(
                [method, " ".join(names), f"{order}", f"{found:.12g}", f"{expected:.12g}",
                 f"{abs(found / expected - 1.0):.1e}", f"{seconds:.1f}"]
            )  # fmt: skip
            print(*rows[-1], flush=True)
            with open(path, "w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([HEADS, *rows])


if __name__ == "__main__":
    main()
