"""What each law leaves of a task over random states: python benchmarks/projection_residuals.py [FILE.json].

The states of `qpsafe compare`, all tasks active and no limits: |J_L q̇ - ẋ_L| of the low-priority task under the
hierarchical laws, |J_H q̇ - ẋ_H| of the high-priority one under the weighted law, by kind of state.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.laws.equivalence import random_states
from qpsafe.text.json_text import json_text

EACH = 100  # states of each kind
LAWS = {
    "paper": (qpsafe.HierarchicalLaw("paper"), False),
    "strict": (qpsafe.HierarchicalLaw("strict"), False),
    "weighted": (qpsafe.WeightedLaw(1e3), True),
}


def residuals() -> dict[str, dict[str, list[float]]]:
    """By kind of state and law."""
    found: dict[str, dict[str, list[float]]] = {}
    for state in random_states(18 * EACH):
        kind = "independent" if state.kind.startswith("independent") else state.kind
        if kind != "independent" and not kind.startswith("irb140"):
            continue
        problem = state._replace(m=1.0, f=1.0).problem()
        for name, (law, high) in LAWS.items():
            J, xd = (state.J_H, state.xd_H) if high else (state.J_L, state.xd_L)
            left = float(np.linalg.norm(J @ law.solve(problem).qd - xd))
            found.setdefault(kind, {}).setdefault(name, []).append(left)
    return found


def main() -> None:
    """Print medians and worst, and write them."""
    table = {
        kind: {
            name: {"states": len(left), "median": float(np.median(left)), "worst": max(left)}
            for name, left in laws.items()
        }
        for kind, laws in residuals().items()
    }
    for kind, laws in table.items():
        print(kind, *(f"{name}: {x['median']:.1e}, {x['worst']:.1e};" for name, x in laws.items()))
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(table) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
