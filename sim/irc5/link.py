"""A bad wire, on purpose: loses, delays, reorders, duplicates and spoils datagrams, by cycles of the robot's clock."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from qpsafe.errors import ConfigurationError


@dataclass(frozen=True)
class WireFaults:
    """What the wire does to datagrams, each way and independently.

    Attributes:
        loss: Share that is lost.
        delay: By how long all are delayed, rounded up to whole cycles [s].
        reorder: Share that is held back for a cycle and arrives after the next one.
        duplicate: Share that arrives twice.
        garbage: Share that is followed by junk, see `spoiled`.
    """

    loss: float = 0.0
    delay: float = 0.0
    reorder: float = 0.0
    duplicate: float = 0.0
    garbage: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value, most = getattr(self, item.name), 10.0 if item.name == "delay" else 1.0
            if not (isinstance(value, int | float) and 0.0 <= value <= most):
                raise ConfigurationError("WireFaults", item.name, value, f"0 to {most:g}")


NO_FAULTS = WireFaults()


class Wire:
    """One direction.

    Args:
        faults: What goes wrong; may be changed at any time.
        rng: Draws when.
        period: Cycle [s].
    """

    def __init__(self, faults: WireFaults, rng: np.random.Generator, period: float = 0.004) -> None:
        self.faults, self._rng, self._period = faults, rng, period
        self._under_way: list[tuple[int, bool, bytes]] = []  # cycle it is due, whether it was held back
        self.cycle = 0
        self.lost = self.duplicated = self.reordered = self.junk = 0

    def draw_anew(self, rng: np.random.Generator) -> None:
        """Draw from another generator from now on."""
        self._rng = rng

    def put(self, datagram: bytes) -> None:
        """Send one."""
        faults, draw = self.faults, self._rng.random
        if faults == NO_FAULTS:
            self._under_way.append((self.cycle, False, datagram))
            return
        if draw() < faults.loss:
            self.lost += 1
            return
        due = self.cycle + int(np.ceil(faults.delay / self._period - 1e-9))
        late = draw() < faults.reorder
        self.reordered += late
        self._under_way.append((due + late, late, datagram))
        if draw() < faults.duplicate:
            self.duplicated += 1
            self._under_way.append((due + int(self._rng.integers(2)), False, datagram))
        if draw() < faults.garbage:
            self.junk += 1
            self._under_way.append((due, False, spoiled(datagram, self._rng)))

    def take(self) -> list[bytes]:
        """What has arrived by now; then the next cycle begins. Held back ones come after those of their own cycle."""
        arrived = [item for item in self._under_way if item[0] <= self.cycle]
        if arrived:
            self._under_way = [item for item in self._under_way if item[0] > self.cycle]
        self.cycle += 1
        return [datagram for _, _, datagram in sorted(arrived, key=lambda item: item[:2])]


def spoiled(datagram: bytes, rng: np.random.Generator) -> bytes:
    """Junk: nothing, text, random bytes, or the datagram without its last byte.

    Flipped bits are none of them: UDP's checksum drops such datagrams, and in a mantissa nobody could tell.
    """
    kinds = b"", b"hello?", rng.bytes(int(rng.integers(1, 400))), datagram[:-1]
    return kinds[int(rng.integers(len(kinds)))]
