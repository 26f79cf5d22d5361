"""What the paper has: evasion tuned by hand, obstacles that stand still, a return as soon as danger falls."""

from __future__ import annotations

from typing import Any

from qpsafe.recovery.returns import RecoveryRules
from qpsafe.sensing.rules import SensingRules

#: Arguments of `SafetyController`: no gate, and nothing is kept clear of.
AS_IN_PAPER: dict[str, Any] = {
    "evasion": "paper", "sensing": SensingRules(velocities=False), "recovery": RecoveryRules.paper(), "gate": "off",
    "clearance": "off", "parameters": "paper",
}  # fmt: skip
