"""The mean of an objective over an ensemble, and its gradient, on all devices of all processes."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from esail_jax.array_types import Array, Scalar
from esail_jax.compilation.jit import jit
from esail_jax.ensembles.sampling import Inputs

MEMBER = "member"


class MeanGradient(NamedTuple):
    """Mean of an objective and its gradient, over the `counted` members for which both are finite."""

    mean: Scalar
    gradient: Any
    counted: Scalar


def mean_gradient(
    objective: Callable[[Any, dict[str, Array]], Scalar], inputs: Inputs
) -> Callable[[Any], MeanGradient]:
    """The function p -> (J(p), dJ/dp, number of members), J(p) = sum_m objective(p, inputs_m) / M.

    p: a tree of arrays; objective(p, inputs of one member): differentiable, made of `simulate`.

    The members are divided evenly among all devices that JAX knows, including those of other processes
    (`jax.distributed`). Every device computes its members one after the other; one collective reduction
    adds the sums. Every process has to call this with the same arguments, and all get the same result."""
    devices = np.array(jax.devices())
    mesh = Mesh(devices, (MEMBER,))
    members = len(next(iter(inputs.values())))
    padding = -members % len(devices)
    # Members that pad the last share have weight 0.
    weights = np.append(np.ones(members), np.zeros(padding))
    filled = {key: np.concatenate([x, x[:1].repeat(padding, 0)]) for key, x in inputs.items()}

    def placed(value: Any, spec: PartitionSpec) -> Array:
        value = np.asarray(value)
        return jax.make_array_from_callback(
            value.shape, NamedSharding(mesh, spec), lambda index: value[index]
        )

    shares = jax.tree.map(lambda x: placed(x, PartitionSpec(MEMBER)), (filled, weights))

    def mean_of_share(parameters, share):
        def evaluate_member(member):
            own, weight = member
            value, gradient = jax.value_and_grad(objective)(parameters, own)
            leaves = [value, *jax.tree.leaves(gradient)]
            good = jnp.stack([jnp.isfinite(x).all() for x in leaves]).all() & (weight > 0.0)
            finite = jax.tree.map(lambda x: jnp.where(good, x, 0.0), (value, gradient))
            return *finite, jnp.where(good, 1.0, 0.0)

        sums = jax.tree.map(lambda x: x.sum(0), lax.map(evaluate_member, share))
        value, gradient, counted = lax.psum(sums, MEMBER)
        return MeanGradient(value / counted, jax.tree.map(lambda x: x / counted, gradient), counted)

    specs = (PartitionSpec(), PartitionSpec(MEMBER))
    evaluate = jit(
        jax.shard_map(mean_of_share, mesh=mesh, in_specs=specs, out_specs=PartitionSpec(), check_vma=False)
    )

    def evaluate_everywhere(parameters: Any) -> MeanGradient:
        placed_parameters = jax.tree.map(lambda x: placed(x, PartitionSpec()), parameters)
        return jax.tree.map(lambda x: np.asarray(x), evaluate(placed_parameters, shares))

    return evaluate_everywhere
