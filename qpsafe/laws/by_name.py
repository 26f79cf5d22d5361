"""The laws, by the names that the command line and the page in the browser use."""

from __future__ import annotations

from typing import Any, cast

from qpsafe.errors import ConfigurationError
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.problem import Law
from qpsafe.laws.weighted import WeightedLaw

LAWS = ("hierarchical", "nullspace", "weighted")
PROJECTIONS = ("strict", "paper")


def law_named(name: str, projection: str = "strict", solver: str | None = None) -> Law:
    """A law.

    Args:
        name: One of `LAWS`.
        projection: Of the hierarchical law, one of `PROJECTIONS`; the others have none, whichever is named.
        solver: Of the QPs; the law's default if None. The null-space law solves none.

    Raises:
        ConfigurationError: There is none of this name, no such projection, or the law has no use for a solver.
    """
    if projection not in PROJECTIONS:
        raise ConfigurationError("law_named", "projection", projection, "one of " + ", ".join(PROJECTIONS))
    if name == "hierarchical":
        return HierarchicalLaw(cast("Any", projection), solver=solver)
    if name == "nullspace":
        if solver is not None:
            raise ConfigurationError("law_named", "solver", solver, "none with the law nullspace: it solves no QP")
        return NullspaceLaw()
    if name == "weighted":
        return WeightedLaw(solver=solver)
    raise ConfigurationError("law_named", "name", name, "one of " + ", ".join(LAWS))
