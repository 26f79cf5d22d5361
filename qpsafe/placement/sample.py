"""What a Monte Carlo sample leaves behind: all that eqs. (9) to (13) need, 21 bytes a detection and 16 a pair."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.errors import ConfigurationError

#: A detected point this near to a person's nearest one tells where that is: less than a hand is long [m].
NEAR = 0.10


class Detections(NamedTuple):
    """Detections of some consecutive pairs: Q_i(q, ξ) of eq. (9) where it is not 0.

    Attributes:
        counts: Detections of each pair, (k,).
        nodes: Node of each detection, pair after pair, (d,).
        danger: Static danger field at each detected point, (d,) [1/m].
        torque: Size of the virtual joint torque that each detection makes by eqs. (14), (15), (d,).
        peak: Largest static danger field on each dummy, (k,) [1/m].
        near: Whether a detected point is within `NEAR` of the dummy's point that is nearest to the robot, (d,).
        on_robot: Spots' rays that met the robot within range before anything else.
        too_near: Rays that met the dummy nearer than the sensor's range.
    """

    counts: NDArray[np.int64]
    nodes: NDArray[np.int32]
    danger: Array
    torque: Array
    peak: Array
    near: NDArray[np.bool_]
    on_robot: int = 0
    too_near: int = 0


@dataclass(frozen=True)
class Sample:
    """A finished sample of P pairs over n nodes.

    Attributes:
        nodes: n.
        first: The detections of pair p are those from first[p] to first[p + 1], (P + 1,).
        node: Node of each detection, (d,).
        danger: Static danger field at each detected point, Q of eq. (9), (d,) [1/m].
        torque: Size of the virtual joint torque that each detection makes by eqs. (14), (15), (d,).
        peak: Largest static danger field on each dummy, max SDF of eq. (12), (P,) [1/m].
        near: Whether a detected point is within `NEAR` of the dummy's point that is nearest to the robot, (d,).
        on_robot: Spots' rays that met the robot within range before anything else.
        too_near: Rays that met the dummy nearer than the sensor's range.
    """

    nodes: int
    first: NDArray[np.int64]
    node: NDArray[np.int32]
    danger: Array
    torque: Array
    peak: Array
    near: NDArray[np.bool_]
    on_robot: int = 0
    too_near: int = 0

    @property
    def pairs(self) -> int:
        """P."""
        return len(self.peak)

    @property
    def pair(self) -> NDArray[np.int32]:
        """Pair of each detection, (d,)."""
        return np.repeat(np.arange(self.pairs, dtype=np.int32), np.diff(self.first))

    def nearest(self) -> Sample:
        """The same sample, in which only detections count that are `near`."""
        kept = np.concatenate(([0], np.cumsum(self.near)))
        arrays = {key: getattr(self, key)[self.near] for key in ("node", "danger", "torque", "near")}
        return replace(self, first=kept[self.first], **arrays)

    def sums(self) -> Array:
        """Sum over pairs of each node's Q, (n,) [1/m]."""
        return np.bincount(self.node, weights=self.danger, minlength=self.nodes).astype(float)

    def moments(self) -> Array:
        """Means over pairs of all products of (Q_1, ..., Q_n, max SDF), (n + 1, n + 1) [1/m^2]."""
        sums = np.zeros((self.nodes + 1, self.nodes + 1))
        _moments(self.first, self.node, self.danger, self.peak, sums)
        return sums / self.pairs

    def seen_by(self, chosen: Iterable[int]) -> Array:
        """The largest danger that some nodes see of each pair, 0 where none detects, (P,) [1/m]."""
        best = np.zeros(self.pairs)
        mask = np.zeros(self.nodes, dtype=bool)
        mask[list(chosen)] = True
        kept = mask[self.node]
        np.maximum.at(best, self.pair[kept], self.danger[kept])
        return best

    @classmethod
    def collect(cls, nodes: int, parts: Iterable[Detections]) -> Sample:
        """Put consecutive parts together."""
        counts, node, danger, torque, peak, near = [], [], [], [], [], []
        on_robot = too_near = 0
        for part in parts:
            counts.append(part.counts)
            node.append(np.asarray(part.nodes, dtype=np.int32))
            danger.append(part.danger)
            torque.append(part.torque)
            peak.append(part.peak)
            near.append(part.near)
            on_robot, too_near = on_robot + part.on_robot, too_near + part.too_near
        if not counts:
            raise ConfigurationError("Sample", "pairs", 0, "at least one")
        first = np.concatenate(([0], np.cumsum(np.concatenate(counts)))).astype(np.int64)
        return cls(
            nodes,
            first,
            np.concatenate(node),
            np.concatenate(danger),
            np.concatenate(torque),
            np.concatenate(peak),
            np.concatenate(near),
            on_robot,
            too_near,
        )


_PLACES, _NODES = types.Array(types.int64, 1, "A", readonly=True), types.Array(types.int32, 1, "A", readonly=True)


@entry(types.void(_PLACES, _NODES, readable(1), readable(1), types.float64[:, ::1]))
def _moments(first: Array, node: Array, danger: Array, peak: Array, sums: Array) -> None:
    n = sums.shape[0] - 1
    for p in range(peak.shape[0]):
        for a in range(first[p], first[p + 1]):
            i = node[a]
            for b in range(first[p], first[p + 1]):
                sums[i, node[b]] += danger[a] * danger[b]
            sums[i, n] += danger[a] * peak[p]
            sums[n, i] += danger[a] * peak[p]
        sums[n, n] += peak[p] * peak[p]
