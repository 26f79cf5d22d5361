"""Images that came, whatever a user gave: those that can be taken now, and what is wrong with the others."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any

from qpsafe.ranging.sensor import RangeImage, RangeSensor


class Inbox:
    """Keeps images until there is time for them.

    Args:
        sensors: Whose images are expected.
        budget: How many zones are taken at once, at most; an image of more is taken alone.
    """

    def __init__(self, sensors: Sequence[RangeSensor], budget: int) -> None:
        self._sizes, self._budget = [len(sensor) for sensor in sensors], budget
        self._index = {sensor.name: i for i, sensor in enumerate(sensors)}
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self._waiting: deque[Any] = deque()

    def take(self, images: Any) -> tuple[list[tuple[int, RangeImage]], list[str]]:
        """Images to be taken now with the numbers of their sensors; what is wrong, in words.

        Args:
            images: That came since the last call, in any order.
        """
        if isinstance(images, RangeImage):
            images = (images,)
        taken: list[tuple[int, RangeImage]] = []
        notes: list[str] = []
        if isinstance(images, Iterable):
            self._waiting.extend(images)
        else:
            notes.append(f"images are no list of RangeImages but {type(images).__name__}")
        used = 0
        while self._waiting:
            who = self._sender(self._waiting[0])
            if isinstance(who, str):
                notes.append(who)
            elif used and used + self._sizes[who] > self._budget:
                break  # the rest waits for the next tick
            else:
                used += self._sizes[who]
                taken.append((who, self._waiting[0]))
            self._waiting.popleft()
        while len(self._waiting) > 4 * len(self._sizes):
            self._waiting.popleft()
            notes.append("images come faster than they can be taken: the oldest are left out")
        return taken, notes

    def _sender(self, image: Any) -> int | str:
        if not (isinstance(image, RangeImage) and isinstance(image.sensor, RangeSensor)):
            return "an image is no RangeImage"
        found = self._index.get(image.sensor.name)
        return f"an image is of {image.sensor.name!r}, which is not among range_sensors" if found is None else found
