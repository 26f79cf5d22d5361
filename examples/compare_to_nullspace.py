"""The same law twice: hierarchical QPs (projection "paper", no active limits) against the paper's eq. (22).

Exit code 1 if any joint velocity differs by more than 1e-8 rad/s. Run: python examples/compare_to_nullspace.py [STATES]
"""

import sys

import numpy as np

from qpsafe import HierarchicalLaw
from qpsafe.laws.equivalence import random_states

TOLERANCE = 1e-8  # [rad/s]
count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000

law = HierarchicalLaw(projection="paper")
worst = {}
deviations = []
for state in random_states(count):  # n = 6, 7, 9; singular and rank-deficient tasks; m and f from 0 to 1
    qp = law.solve(state.problem()).qd
    paper = state.paper_velocity()  # eq. (22), by pseudoinverses
    deviation = float(np.abs(qp - paper).max())
    deviations.append(deviation)
    worst[state.kind] = max(worst.get(state.kind, 0.0), deviation)

for kind, value in worst.items():
    print(f"{kind:32} worst {value:.1e} rad/s")
print(f"{count} states: worst {max(deviations):.1e}, median {np.median(deviations):.1e} rad/s")
sys.exit(0 if max(deviations) <= TOLERANCE else 1)
