"""What a person gives, as numbers."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

MOST_ZONES = 10_000_000


def is_number(value: Any) -> bool:
    """Whether it is a finite real number; whole ones of hundreds of digits are none."""
    if isinstance(value, bool) or not isinstance(value, float | int | np.floating | np.integer):
        return False
    try:
        return isfinite(value)
    except OverflowError:
        return False


def rows_and_columns(shape: Any) -> tuple[int, int] | None:
    """Two whole numbers, whatever they are given as, of no more zones than memory may have room for; else None."""
    try:
        rows, columns = shape
        if not (is_number(rows) and is_number(columns)):
            return None
        whole = int(rows), int(columns)
        fits = whole[0] == rows and whole[1] == columns and abs(whole[0] * whole[1]) <= MOST_ZONES
    except Exception:  # not two, or whatever a stranger's __iter__ raises
        return None
    return whole if fits else None


def parts_of(value: Any) -> tuple[Any, ...]:
    """What something consists of; nothing, where it does not."""
    try:
        return tuple(value)
    except Exception:  # whatever a stranger's __iter__ raises
        return ()
