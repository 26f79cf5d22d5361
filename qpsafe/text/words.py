"""Numbers in sentences."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """The number and its noun, with an s unless there is one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def growth(change: float) -> str:
    """How memory grew, or shrank, from its change in bytes."""
    return f"{'shrunk' if change < 0.0 else 'grown'} by {abs(change) / 1e6:.3f} MB"
