"""The modes of a sail as a table."""

import dataclasses
from typing import Any

import numpy as np

from esail_jax.array_types import Complex, Float, Int
from esail_jax.modal.multipliers import Floquet
from esail_jax.modal.shapes import Places, Shape

Host = np.ndarray


@dataclasses.dataclass(frozen=True)
class Group:
    """Motions that were found together: waves of number n, given for tether 1 (local has one tether), or
    motions of all tethers (n is None). local: (coordinate, tether, mode); hub: (6, mode)."""

    n: int | None
    local: Host
    hub: Host


@dataclasses.dataclass(frozen=True, repr=False)
class ModeTable:
    """Modes of a sail about its spinning equilibrium, sorted by frequency: M u'' + (G + C) u' + K u = 0,
    u ~ exp(s t) in the frame that turns with the sail.

    Every vibration of the discrete sail is one entry; equal tethers give several with the same frequency.
    Motions of the centre of mass and the spin angle are no vibrations and are left out.

    frequency_hz: natural frequency |s| / (2 pi) [Hz], as seen in the rotating frame B; of an overdamped
        vibration the geometric mean of its two rates
    damping_ratio: -Re s / |s|; above 1 for an overdamped vibration, below 0 for a growing one
    name: what moves, derived from the shape
    eigenvalue: s [1/s] with Im s >= 0; its imaginary part is the frequency at which the sail rings
    wave_number: number n of waves around the circle; -1 if the tethers are unequal
    relative_change: change of s, relative to |s|, with twice as many elements; NaN where not computed
    notes: what the modes refer to, and what is left out, in sentences
    coning_angle: of every tether in the equilibrium [rad]; acceleration: along the spin axis [m/s^2]
    spin_rate: [rad/s]
    floquet: multipliers of the periodic orbit at the sailing angle; None unless asked for
    """

    frequency_hz: Float[Host, " mode"]
    damping_ratio: Float[Host, " mode"]
    name: tuple[str, ...]
    eigenvalue: Complex[Host, " mode"]
    wave_number: Int[Host, " mode"]
    kind: tuple[str, ...]
    nodes: Int[Host, " mode"]
    relative_change: Float[Host, " mode"]
    notes: tuple[str, ...]
    coning_angle: Float[Host, " tether"]
    acceleration: float
    spin_rate: float
    motions: tuple[tuple[int, int, bool], ...]
    groups: tuple[Group, ...]
    places: Places
    system: Any
    floquet: Floquet | None = None

    def __len__(self) -> int:
        return len(self.name)

    def first(self, count: int) -> "ModeTable":
        """The table of the first modes."""
        of_modes = (
            "frequency_hz damping_ratio name eigenvalue wave_number kind nodes relative_change motions"
        )
        shorter = {name: getattr(self, name)[:count] for name in of_modes.split()}
        floquet = None if self.floquet is None else self.floquet.first(count)
        return dataclasses.replace(self, **shorter, floquet=floquet)

    def shape(self, mode: int) -> Shape:
        """The shape of a mode: displacements at the points of `places`, along every tether in its
        axes, and of the hub. The largest displacement of a tether is 1."""
        from esail_jax.modal.shapes import shape_of

        place, column, conjugate = self.motions[mode]
        group = self.groups[place]
        local, hub = group.local[:, :, column : column + 1], group.hub[:, column : column + 1]
        if group.n is not None:
            count = self.places.mass.shape[1]
            phase = np.exp(2j * np.pi * group.n * np.arange(count) / count)
            local = local * phase[:, None]
        tether, hub, ring = shape_of(self.system, self.places, local, hub, None)
        if conjugate:
            tether, hub = tether.conj(), hub.conj()
            ring = None if ring is None else ring.conj()
        largest = tether.ravel()[np.abs(tether).argmax()]
        ring = None if ring is None else ring[..., 0] / largest
        return Shape(tether[..., 0] / largest, hub[:, 0] / largest, ring)

    def records(self) -> list[dict[str, Any]]:
        """The modes as dictionaries that JSON can hold."""
        records = []
        for k, name in enumerate(self.name):
            change = float(self.relative_change[k])
            records.append(
                {
                    "frequency_hz": float(self.frequency_hz[k]),
                    "damping_ratio": float(self.damping_ratio[k]),
                    "name": name,
                    "damped_frequency_hz": float(self.eigenvalue[k].imag / (2.0 * np.pi)),
                    "eigenvalue": [float(self.eigenvalue[k].real), float(self.eigenvalue[k].imag)],
                    "wave_number": int(self.wave_number[k]) if self.wave_number[k] >= 0 else None,
                    "kind": self.kind[k],
                    "nodes": int(self.nodes[k]) if self.nodes[k] >= 0 else None,
                    "relative_change": change if np.isfinite(change) else None,
                }
                | self.floquet_record(k)
            )
        return records

    def floquet_record(self, mode: int) -> dict[str, Any]:
        """Multiplier and exponent of a mode for `records`: none unless they were asked for, null
        for a mode that is too fast or decays too fast."""
        if self.floquet is None:
            return {}
        mu, s = complex(self.floquet.multiplier[mode]), complex(self.floquet.exponent[mode])
        known = np.isfinite(mu)
        return {
            "floquet_multiplier": [mu.real, mu.imag] if known else None,
            "floquet_exponent": [s.real, s.imag] if known else None,
            "floquet_damping_ratio": -s.real / abs(s) if known else None,
        }

    def __repr__(self) -> str:
        from esail_jax.modal.text import table_text

        return table_text(self)
