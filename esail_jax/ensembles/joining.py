"""Joining ensembles that were computed one by one, each with a seed of its own, to one sample."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from esail_jax.ensembles.ensemble import Ensemble, concatenate
from esail_jax.errors import InputError
from esail_jax.scenes.toml_text import to_toml


def join(parts: Sequence[Ensemble]) -> Ensemble:
    """One ensemble of the members of several, which are numbered anew: first those of the first
    part, then those of the second.

    All parts must have the same scene, saved instants, observables and varied keys. Parts of the same seed
    have the same members, which would count twice. Raises InputError.

        whole = join([load_ensemble(f"many-{i}/ensemble.h5") for i in range(16)])
    """
    if not parts:
        raise InputError("one ensemble at least must be given, but there is none")
    for number, part in enumerate(parts[1:], 2):
        check_fits(parts[0], part, number)
    for number, part in enumerate(parts, 1):
        if any(same_inputs(part, other) for other in parts[: number - 1]):
            raise InputError(f"the members of part {number} must be new, but an earlier part has the same")
    whole = concatenate(parts)
    return dataclasses.replace(whole, members=np.arange(len(whole)))


def check_fits(first: Ensemble, part: Ensemble, number: int) -> None:
    """Raises InputError if an ensemble cannot form one sample with the first."""
    pairs = {
        "scene": (to_toml(first.scene), to_toml(part.scene)),
        "saved instants": (first.time.tolist(), part.time.tolist()),
        "observables": (sorted(first.keys()), sorted(part.keys())),
        "varied keys": (sorted(first.inputs), sorted(part.inputs)),
    }
    for name, (one, other) in pairs.items():
        if one != other:
            raise InputError(f"part {number} must have the {name} of part 1, but has others")


def same_inputs(one: Ensemble, other: Ensemble) -> bool:
    """Tells whether two ensembles begin with the same member. Without varied keys all members are equal."""
    return all(np.array_equal(one.inputs[key][:1], other.inputs[key][:1]) for key in one.inputs)
