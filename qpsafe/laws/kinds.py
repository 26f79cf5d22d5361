"""Which laws compiled ticks know, by number."""

from __future__ import annotations

from typing import Any

from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.weighted import WeightedLaw

#: The hierarchical law, strict or with the paper's projection; null-space projections; one weighted level.
STRICT, PAPER, NULLSPACE, WEIGHTED = range(4)
#: Any other, or one with another solver than the own one.
OTHER = -1


def kind_of(law: Any, tasks: int) -> int:
    """The number of a law with so many tasks.

    Raises:
        ConfigurationError: It does not fit so many.
    """
    check_fit(law, tasks)
    if type(law) is NullspaceLaw:
        return NULLSPACE
    if type(law) not in (HierarchicalLaw, WeightedLaw) or law.solver not in (None, "own"):
        return OTHER
    if type(law) is HierarchicalLaw:
        return STRICT if law.projection == "strict" or tasks < 2 else PAPER
    return WEIGHTED


def check_fit(law: Any, tasks: int) -> None:
    """Refuse a law whose weights are not for so many tasks: it could answer no tick.

    Raises:
        ConfigurationError: Names the weights, or the ratio.
    """
    if isinstance(law, WeightedLaw):
        law.importance(tasks)


def numbers_of(law: Any, tasks: int) -> tuple[float, float, tuple[float, ...]]:
    """Damping and its time, and the weights w_1, ..., w_N, w_E of a law of these kinds; zeros where it has none.

    Args:
        law: The law.
        tasks: How many.
    """
    if isinstance(law, HierarchicalLaw):
        return law.damping, law.damping_time, (0.0,) * (tasks + 1)
    return 0.0, 0.0, law.importance(tasks) if isinstance(law, WeightedLaw) else (0.0,) * (tasks + 1)
