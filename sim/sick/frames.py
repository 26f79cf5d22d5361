"""What can be wrong with the images of a sensor: each fault makes of an image that came the one that is passed on."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.ranging.sensor import RangeImage, RangeSensor

Numbers = NDArray[np.int64]

#: Of the image that came and the first one since the fault began; None: nothing is passed on.
Spoil = Callable[[RangeImage, RangeImage], RangeImage | None]

LATE = 0.5  # [s]
ZOOM = 1.25  # of a focal length that is wrong


def blind(image: RangeImage, first: RangeImage) -> RangeImage:
    """No zone is valid."""
    return image._replace(valid=np.zeros(len(image.sensor), dtype=bool))


def no_numbers(image: RangeImage, first: RangeImage) -> RangeImage:
    """NaN in all zones, which are called valid."""
    return image._replace(
        distances=np.full(len(image.sensor), np.nan), valid=np.ones(len(image.sensor), dtype=bool), sigma=None
    )


def negative(image: RangeImage, first: RangeImage) -> RangeImage:
    """Minus infinity in one zone, which is called valid."""
    distances, valid = np.array(image.distances), np.ones(len(image.sensor), dtype=bool)
    if image.valid is not None:
        valid[:] = image.valid
    distances[0], valid[0] = -np.inf, True
    return image._replace(distances=distances, valid=valid)


def stale(image: RangeImage, first: RangeImage) -> RangeImage:
    """Taken long ago."""
    return image._replace(stamp=image.stamp - LATE)


def ahead(image: RangeImage, first: RangeImage) -> RangeImage:
    """From the future, by its stamp."""
    return image._replace(stamp=image.stamp + LATE)


def timeless(image: RangeImage, first: RangeImage) -> RangeImage:
    """A stamp that is no time."""
    return image._replace(stamp=np.nan)


def repeated(image: RangeImage, first: RangeImage) -> RangeImage:
    """The same image again and again, stamp and all."""
    return first


def frozen(image: RangeImage, first: RangeImage) -> RangeImage:
    """The same content again and again, with new stamps."""
    return first._replace(stamp=image.stamp)


def shifted(image: RangeImage, first: RangeImage) -> RangeImage:
    """All rows one farther down, the last one first."""
    return _rearranged(image, lambda rows: np.roll(rows, 1, axis=0))


def other_lens(image: RangeImage, first: RangeImage) -> RangeImage:
    """Seen through another lens than anybody knows: of a camera zoomed in."""
    rows, columns = (_zoomed(count) for count in image.sensor.shape)
    return _rearranged(image, lambda all_rows: all_rows[np.ix_(rows, columns)])


def other_optics(image: RangeImage, first: RangeImage) -> RangeImage:
    """Of a sensor with other directions than were declared, as its driver says itself."""
    sensor = image.sensor
    directions = sensor.directions * [1.0, 1.0, ZOOM]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    other = RangeSensor(
        sensor.name, directions, sensor.half_angle / ZOOM, mount=sensor.mount, pose=sensor.pose, shape=sensor.shape,
    )  # fmt: skip
    return image._replace(sensor=other)


def misshapen(image: RangeImage, first: RangeImage) -> RangeImage:
    """A row is missing."""
    return image._replace(distances=np.array(image.distances)[image.sensor.shape[1] :])


def silent(image: RangeImage, first: RangeImage) -> None:
    """Nothing comes."""


class SpoilsFrames:
    """Spoils the images of some sensors, and passes on all others.

    Args:
        names: Of the sensors.
        spoil: What is wrong with them.
        count: How many images of each are spoilt.
    """

    def __init__(self, names: Collection[str], spoil: Spoil, count: float = np.inf) -> None:
        self._names, self._spoil, self._left = frozenset(names), spoil, dict.fromkeys(names, count)
        self._first: dict[str, RangeImage] = {}

    def __call__(self, images: list[RangeImage]) -> list[RangeImage]:
        """What the controller is given of the images that came."""
        passed = []
        for image in images:
            name = image.sensor.name
            if name in self._names and self._left[name] > 0:
                self._left[name] -= 1
                spoilt = self._spoil(image, self._first.setdefault(name, image))
                passed += [] if spoilt is None else [spoilt]
            else:
                passed.append(image)
        return passed


def _rearranged(image: RangeImage, order: Callable[[Numbers], Numbers]) -> RangeImage:
    """All parts of an image with its zones in another order."""
    numbers = np.arange(len(image.sensor)).reshape(image.sensor.shape)
    zones = order(numbers).ravel()

    def moved(part: ArrayLike | None) -> ArrayLike | None:
        return part if part is None or np.size(part) != len(zones) else np.asarray(part).ravel()[zones]

    distances = np.asarray(image.distances).ravel()[zones]
    return image._replace(distances=distances, valid=moved(image.valid), sigma=moved(image.sigma))


def _zoomed(count: int) -> Numbers:
    """Which of the rows or columns stand where, the middle ones spread out."""
    middle = 0.5 * (count - 1)
    return np.rint(middle + (np.arange(count) - middle) / ZOOM).astype(np.int64)
