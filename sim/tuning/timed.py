"""Work with its number and what it cost: what comes back in any order."""

from __future__ import annotations

from time import process_time
from typing import NamedTuple

from qpsafe.sim.tuning.objectives import Outcome
from qpsafe.sim.tuning.play import Piece, PieceFunction


class Timed(NamedTuple):
    """Plays numbered pieces.

    Attributes:
        play: Plays one.
    """

    play: PieceFunction

    def __call__(self, numbered: tuple[int, Piece]) -> tuple[int, list[list[Outcome]], float]:
        """Number, outcomes, and processor time [s]."""
        number, piece = numbered
        begun = process_time()
        return number, self.play(piece), process_time() - begun
