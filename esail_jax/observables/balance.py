"""Check of a finished run's energy balance."""

from collections.abc import Mapping

import numpy as np

BALANCE_TOLERANCE = 1e-3
"""A warning is given if the error of the balance exceeds this fraction of its largest term."""

ROUNDING = 1e-9
"""Rounding error of a balance, as a fraction of the energy."""

TERMS = ("kinetic_energy", "elastic_energy", "external_work", "dissipated_energy", "energy_balance_error")


def balance_warning(rows: Mapping[str, np.ndarray]) -> str:
    """A warning if the energy balance of a run is violated, otherwise an empty text.

    It is violated if |dE - W + D|, less the work of winches, exceeds both BALANCE_TOLERANCE of the largest
    of |dE|, |W|, |D| and that work, and ROUNDING of E. For a chain without loads and damping: if |E - E_0|
    exceeds BALANCE_TOLERANCE of the energy, which is then constant. A run that did not save these
    observables is not judged."""
    needed = TERMS if "energy_balance_error" in rows else ("energy_error",)
    if not all(name in rows for name in needed):
        return ""
    if "energy_balance_error" not in rows:
        missing = largest(rows["energy_error"])
        return f"{SENTENCE} {missing:.1e} of the energy." if missing > BALANCE_TOLERANCE else ""
    kinetic, elastic, work, dissipated, error = (rows[name] for name in TERMS)
    energy, missing = kinetic + elastic, largest(error)
    terms = max(largest(energy - energy[:1]), largest(work), largest(dissipated))
    terms = max(terms, largest(rows.get("winch_work", work)))
    if missing <= max(BALANCE_TOLERANCE * terms, ROUNDING * largest(energy)):
        return ""
    return f"{SENTENCE} {missing:.1e} J, where its largest term is {terms:.1e} J."


SENTENCE = "The result may be wrong (try a shorter step or tolerance): its energy balance is off by"


def largest(values: np.ndarray) -> float:
    """The largest magnitude of the finite values, 0 if there are none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else 0.0
