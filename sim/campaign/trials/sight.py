"""Who is seen when: which person a point, a capsule or a board belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.person import SEGMENTS

if TYPE_CHECKING:
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]

ON = 0.05  # a point so near to a body or a board is on it: as far as held points, noise and cones may be off [m]
LATER = 5  # ticks between two looks for those who are not the first to be seen


def person_of(tracks: PersonTracks, segment: int, owners: Sequence[int]) -> int:
    """Number of the person to whom a capsule or board belongs.

    Args:
        tracks: Everybody.
        segment: Number of the capsule; from the number of capsules on, that of a board.
        owners: Who carries each board.
    """
    board = segment - len(tracks.radii)
    return segment // len(SEGMENTS) if board < 0 else owners[board]


def first_seen(points: Sequence[Array], tracks: PersonTracks, owners: Sequence[int]) -> list[int]:
    """The first tick at which a point lies on each person; the number of ticks for those who are never seen.

    Args:
        points: Seen at every tick (p, 3) [m].
        tracks: Everybody.
        owners: Who carries each board.
    """
    count, never = len(tracks.radii) // len(SEGMENTS), len(points)
    found = [never] * count
    looked = -LATER
    for k, seen in enumerate(points):
        missing = [person for person in range(count) if found[person] == never]
        if not missing:
            break
        if not len(seen) or (len(missing) < count and k - looked < LATER):
            continue
        looked = k
        for person in missing:
            if _on(seen, tracks, k, person, owners):
                found[person] = k
    return found


def _on(seen: Array, tracks: PersonTracks, k: int, person: int, owners: Sequence[int]) -> bool:
    """Whether any of some points (p, 3) lies on a person or what they carry."""
    mine = slice(person * len(SEGMENTS), (person + 1) * len(SEGMENTS))
    start, axis = tracks.ends[k, mine, 0], tracks.ends[k, mine, 1] - tracks.ends[k, mine, 0]
    away = seen[:, None] - start[None]
    along = (away * axis).sum(axis=2) / np.maximum((axis * axis).sum(axis=1), 1e-12)
    away -= np.clip(along, 0.0, 1.0)[:, :, None] * axis
    if (np.sqrt((away * away).sum(axis=2)) <= tracks.radii[mine] + ON).any():
        return True
    for board, owner in enumerate(owners):
        if owner == person:
            pose = tracks.boards[k, board]
            local = np.abs((seen - pose[:3, 3]) @ pose[:3, :3])
            if (local <= tracks.half_sizes[board] + ON).all(axis=1).any():
                return True
    return False
