"""Greedy choice of nodes that do not repeat each other, and how far from the optimum it can be.

What chosen nodes S are worth is a sum over cases of the best that any of them contributes,

    f(S) = sum over cases of  max over i in S of v_i,      v_i = 0 where node i detects nothing.

A case is a pair, and v_i = 1: f is the number of detected pairs, (13), or of those of which the point nearest to the
robot is seen. Or a case is a pair seen from one link, and
v_i = Q_i of eq. (9) or the size of the torque (14), (15) that it makes. Of two nodes of a link that see the same
person only the better one counts: redundant nodes do not pay, as they do in (11). Links count one by one since each
evades by a danger vector of its own, eq. (8). What an array sees acts on the link nearest to it, whichever carries the
array: there all nodes count as of one link.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.placement.sample import Sample


class Worth(NamedTuple):
    """What f counts.

    Attributes:
        case: Of each detection, (d,).
        cases: How many there are.
        value: v of each detection, (d,) >= 0.
    """

    case: NDArray[np.int64]
    cases: int
    value: Array


def detected_pairs(sample: Sample) -> Worth:
    """f = number of detected pairs."""
    return Worth(sample.pair.astype(np.int64), sample.pairs, np.ones(len(sample.node)))


def seen_by_links(sample: Sample, links: NDArray[np.int64], value: Array) -> Worth:
    """f = sum over pairs and links of the largest value that a node of the link has.

    Args:
        sample: Who detects what.
        links: Of each node, (n,).
        value: Of each detection, (d,) >= 0: `sample.danger` or `sample.torque`.
    """
    count = int(links.max()) + 1
    return Worth(sample.pair.astype(np.int64) * count + links[sample.node], sample.pairs * count, value)


class Caps(NamedTuple):
    """How many nodes of a kind may be chosen.

    Attributes:
        kind: Of each node, (n,).
        most: Of each kind, (kinds,).
    """

    kind: NDArray[np.int64]
    most: NDArray[np.int64]

    @classmethod
    def none(cls, nodes: int) -> Caps:
        """As many as there are."""
        return cls(np.zeros(nodes, dtype=np.int64), np.array([nodes], dtype=np.int64))

    def fill(self, nodes: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those of some nodes, in their order, that there is room for from the beginning."""
        place = np.empty(len(nodes), dtype=np.int64)  # of each node among those of its kind
        for kind in range(len(self.most)):
            mine = self.kind[nodes] == kind
            place[mine] = np.arange(int(mine.sum()))
        return nodes[place < self.most[self.kind[nodes]]]

    def room(self) -> int:
        """How many nodes can be chosen at most."""
        return int(np.minimum(np.bincount(self.kind, minlength=len(self.most)), self.most).sum())


class Greedy(NamedTuple):
    """Nodes in the order a greedy choice takes them, and what bounds the optimum.

    Attributes:
        order: All nodes, or as many as caps allow, (k,).
        value: f of the first 0, 1, ... of them, (k + 1,).
        bound: f of no choice of 0, 1, ... nodes is larger, (k + 1,).
    """

    order: NDArray[np.intp]
    value: Array
    bound: Array


def greedy(nodes: int, node: NDArray[np.int32], worth: Worth, caps: Caps | None = None) -> Greedy:
    """Take the node that adds most to f, again and again; the first of equals.

    Args:
        nodes: n.
        node: Of each detection, (d,).
        worth: What f counts.
        caps: How many nodes of a kind may be chosen.

    f is submodular: a node adds less the more there are. So f of k nodes is at most f(S) and the k largest gains over
    S, for any S; `bound` is the smallest of these over the greedy sets S. Greedy itself reaches 1 - 1/e of the
    optimum, half of it with caps.
    """
    n = nodes
    caps = caps or Caps.none(n)
    kind, room = caps.kind, caps.most.copy()
    by_node = np.argsort(node, kind="stable")
    begin = np.concatenate(([0], np.cumsum(np.bincount(node, minlength=n)))).astype(np.int64)
    case, v = worth.case[by_node], worth.value[by_node]
    best, gains = np.zeros(worth.cases), np.zeros(n)
    chosen = np.zeros(n, dtype=bool)
    order: list[int] = []
    value, bound, reached = np.zeros(n + 1), np.full(n + 1, np.inf), 0.0
    for k in range(n + 1):
        _gains(begin, case, v, best, gains)
        value[k] = reached
        rest = np.flatnonzero(~chosen)
        rest = caps.fill(rest[np.argsort(-gains[rest], kind="stable")])
        largest = np.concatenate(([0.0], np.cumsum(gains[rest])))
        bound = np.minimum(bound, reached + largest[np.minimum(np.arange(n + 1), len(largest) - 1)])
        open_ = ~chosen & (room[kind] > 0)
        if not open_.any():
            break
        i = int(np.argmax(np.where(open_, gains, -1.0)))
        chosen[i] = True
        room[kind[i]] -= 1
        order.append(i)
        own = slice(begin[i], begin[i + 1])
        best[case[own]] = np.maximum(best[case[own]], v[own])
        reached += float(gains[i])
    last = len(order) + 1
    return Greedy(np.array(order, dtype=np.intp), value[:last], np.maximum(bound, value)[:last])


_PLACES = types.Array(types.int64, 1, "A", readonly=True)


@entry(types.void(_PLACES, _PLACES, readable(1), readable(1), types.float64[::1]))
def _gains(begin: Array, case: Array, v: Array, best: Array, gains: Array) -> None:
    """What each node would add to f."""
    for i in range(gains.shape[0]):
        gain = 0.0
        for a in range(begin[i], begin[i + 1]):
            more = v[a] - best[case[a]]
            if more > 0.0:
                gain += more
        gains[i] = gain


def progress_of(nodes: int, node: NDArray[np.int32], worth: Worth, order: NDArray[np.intp]) -> Array:
    """f of the first 0, 1, ... nodes of an order, (k + 1,); arguments as for `greedy`.

    Args:
        nodes: How many there are.
        node: Node of every detection.
        worth: What detections are worth.
        order: Nodes (k,), first chosen first.
    """
    rank = np.full(nodes, len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    # case by case, in the order of the nodes: every new largest value adds its excess over the last one
    by_rank = np.lexsort((rank[node], worth.case))
    steps = np.zeros(len(order) + 1)
    _steps(worth.case[by_rank], rank[node[by_rank]], worth.value[by_rank], steps)
    return np.concatenate(([0.0], np.cumsum(steps[:-1])))


@entry(types.void(_PLACES, _PLACES, readable(1), types.float64[::1]))
def _steps(case: Array, rank: Array, v: Array, steps: Array) -> None:
    best = 0.0
    for a in range(case.shape[0]):
        if a == 0 or case[a] != case[a - 1]:
            best = 0.0
        if v[a] > best:
            steps[rank[a]] += v[a] - best
            best = v[a]
