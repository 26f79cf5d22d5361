"""What must never happen: a controller that passes limits, or one that is worse for people than no control at all."""

from __future__ import annotations

import numpy as np

from qpsafe.sim.campaign.report.measures import SHARES
from qpsafe.sim.campaign.report.statistics import holm, mcnemar
from qpsafe.sim.campaign.trials.rows import Columns
from qpsafe.text.words import counted

#: Whom nobody may be worse than.
NOBODY = "none"
#: By what.
WORSE_BY = ("contacts", "towards", "over_limit")
LEVEL = 0.05
TOLERANCE = 1e-9  # of a limit, relative to it


def findings(rows: dict[str, Columns]) -> list[str]:
    """Faults in words, one a line, none if there are none.

    A controller is worse than none if more trials end badly with it only than without control only, by McNemar's
    test below 0.05 after Holm's correction over all tests made here.

    Args:
        rows: Of each controller, the same trials in the same order.
    """
    found = []
    for name, mine in rows.items():
        excess = np.where(np.isnan(mine["limit_excess"]), np.inf, mine["limit_excess"])
        if (passed := int((excess > TOLERANCE).sum())) > 0:
            most = excess[np.isfinite(excess)].max(initial=0.0)
            by = f", by {100 * most:.2g} %" if most > TOLERANCE else ""
            wild = int((~np.isfinite(excess)).sum())
            more = f", in {counted(wild, 'trial')} by a command that is no number" if wild else ""
            found.append(f"{name} passes a joint limit in {counted(passed, 'trial')}{by}{more}")
        if (bad := int((mine["bad_ticks"] > 0).sum())) > 0:
            found.append(f"{name} gives a bad command in {counted(bad, 'trial')}")
    if NOBODY not in rows:
        return found
    others = [name for name in rows if name != NOBODY]
    tests = [
        (name, share, mcnemar(share.hits(rows[name]), share.hits(rows[NOBODY])))
        for name in others
        for share in SHARES
        if share.name in WORSE_BY
    ]
    for (name, share, test), p in zip(tests, holm([test.p for *_, test in tests]), strict=True):
        if test.only_first > test.only_second and p < LEVEL:
            found.append(
                f"{name} is worse than no control: {share.meaning} in {counted(test.only_first, 'trial')} with it "
                f"only, in {test.only_second} without control only (p = {p:.2g})"
            )
    return found
