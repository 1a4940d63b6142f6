"""The results of an ensemble."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from esail_jax.array_types import Bool, Float
from esail_jax.ensembles.sampling import Inputs
from esail_jax.observables import described, hint_at
from esail_jax.scenes.key_reference import unit_of
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.solution import labelled, time_attributes

Rows = dict[str, Float[np.ndarray, "member time ..."]]


@dataclasses.dataclass(frozen=True)
class Ensemble:
    """Members of an ensemble and their observables; `ensemble["coning_angle"]` is (member, time, ...).

    members: their numbers; time [s]: saved instants; inputs: by scene key, member first;
    observables: by name, (member, time, ...), NaN after a failure; complete: true for members that reached
    their end; messages: warning or failure of every member, or an empty text; steps: number of steps of
    every member, NaN if the member is not computed yet; reduced: numbers that stand for histories, such as
    `coning_angle.mean`, (member, ...), of an ensemble that keeps only these."""

    scene: Scene
    members: np.ndarray
    time: Float[np.ndarray, " time"]
    inputs: Inputs
    observables: Rows
    complete: Bool[np.ndarray, " member"]
    messages: tuple[str, ...]
    steps: Float[np.ndarray, " member"]
    reduced: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __getitem__(self, name: str) -> Float[np.ndarray, "member *some"]:
        if name in self.reduced:
            return np.asarray(self.reduced[name])  # they may be those of an open file
        if name not in self.observables:
            own = [x for x in self.reduced if x.partition(".")[0] == name]
            hint = hint_at(name, self.observables, self.scene.chain is not None)
            hint = f" (only {', '.join(own)})" if own else hint
            raise KeyError(f"{name!r} is no observable of this ensemble{hint}")
        return self.observables[name]

    def __contains__(self, name: object) -> bool:
        return name in self.observables or name in self.reduced

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self.members)

    def __repr__(self) -> str:
        complete, end = int(self.complete.sum()), float(self.time[-1])
        names = list(self.keys())
        observables = f"{len(names)} observables" if len(names) > 6 else f"observables {', '.join(names)}"
        return (
            f"Ensemble({len(self)} members, {complete} complete; {len(self.time)} instants to {end:g} s; "
            f"{observables})"
        )

    def keys(self) -> Iterable[str]:
        """Names of the observables, and of the reduced ones."""
        return [*self.observables, *self.reduced]

    @property
    def failed(self) -> np.ndarray:
        """Numbers of the members that did not reach their end."""
        return self.members[~self.complete]

    @property
    def warned(self) -> np.ndarray:
        """Numbers of the members that reached their end, but with a warning."""
        return self.members[self.complete & (np.array(self.messages, object) != "")]

    def to_xarray(self) -> Any:
        """The ensemble as an `xarray.Dataset` with units, symbols, equations and named axes, `member` and
        `time` first. Inputs have the names of their keys; `complete`, `message` and `steps` stand beside
        them.

        Raises ImportError if xarray is not installed."""
        import xarray

        data: dict[str, Any] = {}
        for key, values in self.inputs.items():
            axes = ["member", *(f"{key}_{k + 1}" for k in range(values.ndim - 1))]
            unit = unit_of(key)
            data[key] = (axes, np.asarray(values), {"units": unit} if unit else {})
        data["complete"] = ("member", np.asarray(self.complete))
        data["message"] = ("member", np.array(self.messages, object))
        data["steps"] = ("member", np.asarray(self.steps))
        for name, values in self.observables.items():
            entry = described(name, self.scene.chain is not None)
            data[name] = labelled(entry, np.asarray(values), ("member", "time"))
        for name, values in self.reduced.items():
            entry = described(name.partition(".")[0], self.scene.chain is not None)
            data[name] = labelled(entry, np.asarray(values), ("member",))
        time = ("time", np.asarray(self.time), time_attributes(self.scene))
        return xarray.Dataset(data, coords={"member": np.asarray(self.members), "time": time})


def concatenate(parts: Sequence[Ensemble]) -> Ensemble:
    """One ensemble of the members of several parts, which share scene and instants."""
    first = parts[0]

    def column(name):
        return np.concatenate([getattr(part, name) for part in parts])

    def columns(name):
        of_parts = [getattr(part, name) for part in parts]
        return {key: np.concatenate([x[key] for x in of_parts]) for key in getattr(first, name)}

    messages = tuple(text for part in parts for text in part.messages)
    return Ensemble(
        first.scene, column("members"), first.time, columns("inputs"), columns("observables"),
        column("complete"), messages, column("steps"), columns("reduced"),
    )  # fmt: skip
