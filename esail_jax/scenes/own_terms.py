"""Checks of the terms that a user adds to a scene (`physics.py`). A scene without them is read without
JAX."""

import dataclasses
import sys
from typing import Any

from esail_jax.scenes.rules import SceneError

OWN_TERMS = "terms"
"""Key of the terms among the overrides of a scene. It is no table, and no file can have it."""

KINDS = ("Energy", "Dissipation", "Load", "TipLoad", "HubLoad", "Field", "WinchLaw")
"""Classes of `physics.py`, one of which every term has as its base."""


@dataclasses.dataclass(frozen=True)
class AbsentTerms:
    """The terms of a run whose file holds their names only. names: as in the run file."""

    names: tuple[str, ...]


def checked_terms(terms: Any) -> tuple[Any, ...] | AbsentTerms:
    """The terms of a scene as a tuple. Raises SceneError for anything that is no term."""
    if terms is None or isinstance(terms, AbsentTerms):
        return terms or ()
    if not isinstance(terms, list | tuple):
        hint = " (write [term])" if kind_of(terms) else ""
        raise SceneError(OWN_TERMS, "be a list of terms", f"is a {type(terms).__name__}{hint}")
    for i, term in enumerate(terms):
        if kind_of(term) is None:
            got = "is the class: write its parentheses" if isinstance(term, type) else "is of none"
            name = term.__name__ if isinstance(term, type) else type(term).__name__
            must = f"be of one of the kinds of `esail_jax.physics`, {', '.join(KINDS)}"
            raise SceneError(f"{OWN_TERMS}[{i}]", must, f"{name} {got}")
    return tuple(terms)


def kind_of(term: Any) -> str | None:
    """The kind of a term, None for anything else. A term exists only where `terms.py` is imported."""
    module = sys.modules.get("esail_jax.terms")
    if module is None:
        return None
    return next((name for name in KINDS if isinstance(term, getattr(module, name))), None)


def check_own_terms(scene: Any) -> None:
    """Raises SceneError unless every term has the part on which it acts."""
    if isinstance(scene.terms, AbsentTerms):
        return
    for i, term in enumerate(scene.terms):
        kind, name = kind_of(term), f"{OWN_TERMS}[{i}]"
        got = f"{type(term).__name__} is a {kind}"
        if kind == "HubLoad" and scene.hub is None:
            raise SceneError(name, "be no HubLoad without [hub]", got)
        if kind == "WinchLaw" and (scene.deployment is None or scene.deployment.law != "tension"):
            raise SceneError(name, 'be no WinchLaw without the law "tension" of [deployment]', got)
        if kind == "WinchLaw":
            check_winch_law(term, name)
        if scene.chain is not None and kind == "TipLoad":
            raise SceneError(name, "be no TipLoad with a chain", got)
        if scene.chain is not None and hasattr(term, "commanded"):
            raise SceneError(name, "have no `commanded` with a chain", f"{type(term).__name__} has it")
        if kind == "Load" and not {"r"} <= set(term.depends_on or ()) <= {"r", "r_x", "r_xx"}:
            must = 'be a tuple of "r" and, where it needs them, "r_x" and "r_xx"'
            raise SceneError(f"{name}.depends_on", must, f"is {term.depends_on!r}")
        if kind in ("Energy", "Dissipation") and "r_xx" in term.depends_on:
            if scene.chain is not None or scene.tethers.element != "cable":
                must = "not depend on the curvature without cable elements"
                raise SceneError(name, must, f"{type(term).__name__} does")


def check_winch_law(law: Any, name: str) -> None:
    """Raises SceneError unless a winch law has one of the two sets of methods, and with a memory a
    period."""
    none = sys.modules["esail_jax.terms"].WinchLaw.tension
    methods = ["tension"] if type(law).tension is not none else []
    methods += [x for x in ("init", "update") if callable(getattr(law, x, None))]
    if methods not in (["tension"], ["init", "update"]):
        must = "have the method `tension`, or the methods `init` and `update`"
        raise SceneError(name, must, f"{type(law).__name__} has {' and '.join(methods) or 'none of them'}")
    if "update" in methods and not hasattr(law, "period"):
        raise SceneError(f"{name}.period", "be given for a law with `update`", "is missing")


def check_has_terms(scene: Any) -> None:
    """Raises SceneError for a scene of terms in Python without the terms, such as that of a run file."""
    if isinstance(scene.terms, AbsentTerms):
        names = ", ".join(x.split()[0] for x in scene.terms.names)
        raise SceneError(OWN_TERMS, f"be given, as the run had {names}", "is missing")
