"""The control period of a scene: that of its voltage law and of its winch laws, which share one clock."""

from typing import Any

from esail_jax.scenes.own_terms import OWN_TERMS, AbsentTerms, kind_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.voltage import PERIOD, period_of


def control_periods(scene: Any) -> dict[str, float]:
    """The control periods [s] of all sampled laws, by name. Raises SceneError."""
    laws = {PERIOD: scene.voltage_law}
    if not isinstance(scene.terms, AbsentTerms):
        terms = enumerate(scene.terms)
        laws |= {f"{OWN_TERMS}[{i}].period": term for i, term in terms if kind_of(term) == "WinchLaw"}
    periods = {name: period_of(law, name) for name, law in laws.items()}
    return {name: period for name, period in periods.items() if period is not None}


def control_period(scene: Any) -> tuple[str, float] | None:
    """The control period [s] of a scene, and its name; None without a sampled law."""
    return next(iter(control_periods(scene).items()), None)


def check_one_clock(scene: Any) -> None:
    """Raises SceneError unless all sampled laws have the same period."""
    periods = control_periods(scene)
    for name, period in periods.items():
        first, clock = next(iter(periods.items()))
        if period != clock:
            raise SceneError(name, f"be that of `{first}`, {clock:g}", f"is {period:g}")
