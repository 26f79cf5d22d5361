"""What the gate did to a command, for the tick."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from qpsafe.gate.gate_kernel import WORTH_SAYING

#: What a tick says where its command is not verified.
TOO_NEAR = "a link that could touch somebody moves towards them faster than allowed, though it brakes: seen too late"
TOO_LONG = "braking at these limits takes too long to be looked at within a tick: the robot brakes, not verified"


class Gated(NamedTuple):
    """What the gate did to a command.

    Attributes:
        share: λ, how much of the way from braking to the command was let through, 0 to 1.
        cause: ``person``, ``furniture`` or ``self``; empty where all was let through.
        link: What of the robot came too near: name of a collision geometry.
        other: What it came too near to: a known obstacle or a geometry of the robot; empty for a person.
        point: Which seen point, -1 for none.
        short: Where even braking approaches somebody too fast, by how much in all [m]: somebody was seen where, by
            the figures, nobody could be. Then braking or the command is sent, whichever comes nearer by less. Infinite
            where the way is too long to be looked at in a tick, with limits of minutes of braking: it brakes.
    """

    share: float = 1.0
    cause: str = ""
    link: str = ""
    other: str = ""
    point: int = -1
    short: float = 0.0

    @property
    def verified(self) -> bool:
        """Whether the robot can stop, or go away, before anybody reaches it."""
        return self.short == 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the tick's messages: where braking is short of more than 1 mm."""
        if self.short == inf:
            return (TOO_LONG,)
        return (TOO_NEAR,) if self.short > WORTH_SAYING else ()

    def __str__(self) -> str:
        if not self.cause:
            return "all of the command is verified"
        other = f"point {self.point}" if self.cause == "person" else self.other
        words = f"{100.0 * self.share:.0f} % of the command let through: {self.link} near {other} ({self.cause})"
        if self.verified:
            return words
        return f"{words}; {TOO_LONG if self.short == inf else f'braking comes {1e3 * self.short:.1f} mm too near'}"


PASSED = Gated()
NO_AGES = np.empty(0)
"""Where nothing tells how old it is."""
