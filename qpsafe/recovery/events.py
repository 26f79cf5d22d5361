"""Events of trajectories: each happens once, when the path's clock comes to it."""

from __future__ import annotations

from typing import Any


class Cursor:
    """Which event of a trajectory comes next; it only ever moves forward.

    Args:
        trajectory: Whatever it follows; may have no events.
        time: On the path, from where on events count [s].
        passed: Events (time, name) that have been; added to.
    """

    def __init__(self, trajectory: Any, time: float, passed: set[tuple[float, str]]) -> None:
        self.trajectory = trajectory
        self.count = 0
        count, events = self.due_until(time)  # what is past when the trajectory is taken up will not happen
        for k, event in enumerate(events):
            if not (event[0] < time or event in passed):
                count = k
                break
        self.count = count

    def due(self, time: float) -> bool:
        """Whether the next event is due."""
        event = self.trajectory.event(self.count)
        return event is not None and event.time <= time

    def due_until(self, time: float) -> tuple[int, list[tuple[float, str]]]:
        """Number of the first event after `time`, and times and names of those before it that have not been passed."""
        count, found = self.count, []
        while (event := self.trajectory.event(count)) is not None and event.time <= time:
            found.append((float(event.time), str(event.name)))
            count += 1
        return count, found
