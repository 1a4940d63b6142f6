"""Is a run's energy accounted for?"""

from collections.abc import Mapping

import numpy as np

BALANCE_TOLERANCE = 1e-3
"""Part of the largest term of the balance that may be missing."""

ROUNDING = 1e-9
"""Part of the energy that is lost in any account of it."""

TERMS = ("kinetic_energy", "elastic_energy", "external_work", "dissipated_energy", "energy_balance_error")


def balance_warning(rows: Mapping[str, np.ndarray]) -> str:
    """A sentence if |dE - W + D| exceeds BALANCE_TOLERANCE of the largest of |dE|, |W| and |D| and ROUNDING of E;
    of a chain, if |E - E_0| exceeds BALANCE_TOLERANCE of its energy. Else nothing."""
    if "energy_error" in rows:
        lost = largest(rows["energy_error"])
        return f"{SENTENCE} {lost:.1e} of the energy." if lost > BALANCE_TOLERANCE else ""
    kinetic, elastic, work, dissipated, error = (rows[name] for name in TERMS)
    energy, lost = kinetic + elastic, largest(error)
    terms = max(largest(energy - energy[:1]), largest(work), largest(dissipated))
    if lost <= max(BALANCE_TOLERANCE * terms, ROUNDING * largest(energy)):
        return ""
    return f"{SENTENCE} {lost:.1e} J, where its largest term is {terms:.1e} J."


SENTENCE = "The result may be wrong (try a shorter step or tolerance): its energy balance is off by"


def largest(values: np.ndarray) -> float:
    """Largest magnitude of what is finite; 0 of nothing."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else 0.0
