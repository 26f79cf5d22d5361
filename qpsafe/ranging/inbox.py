"""Images that came, whatever a user gave: those that can be taken now, and what is wrong with the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import deepcopy
from math import inf
from operator import itemgetter
from typing import Any

from qpsafe.errors import in_words
from qpsafe.ranging.checks import as_time
from qpsafe.ranging.sensor import RangeImage, RangeSensor
from qpsafe.sensing.detection import BadInput

#: Images of each sensor that wait, at most, while no tick can take any; and for the next one, where there is no time.
MOST, LEFT = 100, 4


class Inbox:
    """Keeps images until there is time for them. Those of a tick are the caller's; those that it leaves, copies.

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
        self._waiting: list[tuple[float, int, RangeImage]] = []
        self._foreign = False  # whether any of these may not be ours
        self._notes: list[str] = []

    def put(self, images: Any) -> None:
        """Keep images until they are taken, the oldest first: what one has lost, a later one may look through.

        Args:
            images: That came since the last call, in any order.
        """
        if isinstance(images, RangeImage):
            images = (images,)
        if not (type(images) is list or isinstance(images, Iterable)):
            self._notes.append(f"images are no list of RangeImages but {type(images).__name__}")
            return
        try:
            for image in images:
                who = self._sender(image)
                if isinstance(who, str):
                    self._notes.append(who)
                else:
                    self._waiting.append((_when(image), who, image))
                    self._foreign = True
        except Exception as error:  # a generator of the caller's: what it gave before counts
            self._notes.append(f"images end before their time: {in_words(error)}")
        if len(self._waiting) > 1:
            self._waiting.sort(key=itemgetter(0, 1))
            self._leave_out(MOST)

    def take(self) -> tuple[list[tuple[int, RangeImage]], list[str]]:
        """Images to be taken now with the numbers of their sensors; what is wrong, in words."""
        used, count = 0, 0
        for _, who, _ in self._waiting:
            used += self._sizes[who]
            if count and used > self._budget:
                break  # the rest waits for the next tick
            count += 1
        taken, self._waiting = [one[1:] for one in self._waiting[:count]], self._waiting[count:]
        self._leave_out(LEFT)
        self.keep()
        notes, self._notes = self._notes, []
        return taken, notes

    def keep(self) -> None:
        """Make what still waits at the end of a tick ours: its buffers are the caller's, who may use them again."""
        if not self._foreign:
            return
        ours: list[tuple[float, int, RangeImage]] = []
        for stamp, who, image in self._waiting:
            try:
                own = image if type(image) is _Own else _Own(image.sensor, *deepcopy(image[1:]))
                ours.append((stamp, who, own))
            except Exception as error:  # whatever a stranger's __deepcopy__ raises
                self._notes.append(f"an image of {image.sensor.name} that had to wait is lost: {in_words(error)}")
        self._waiting, self._foreign = ours, False

    def _leave_out(self, most: int) -> None:
        """Let no more images wait than so many for each sensor."""
        more = len(self._waiting) - most * len(self._sizes)
        if more > 0:
            del self._waiting[:more]
            self._notes.append("images come faster than they can be taken: the oldest are left out")

    def _sender(self, image: Any) -> int | str:
        if not (isinstance(image, RangeImage) and isinstance(image.sensor, RangeSensor)):
            return "an image is no RangeImage"
        found = self._index.get(image.sensor.name)
        return f"an image is of {image.sensor.name!r}, which is not among range_sensors" if found is None else found


class _Own(RangeImage):
    """An image that nobody else can write to."""

    __slots__ = ()


def _when(image: RangeImage) -> float:
    """The stamp of an image; what is none comes first, to be refused."""
    try:
        return as_time("stamp", image.stamp)
    except BadInput:
        return -inf
