"""Eqs. (10) to (12): the placement of least cost for a number of spots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.placement.coverage import Caps
from qpsafe.placement.sample import Sample

Array = NDArray[np.float64]


def cheapest_order(sample: Sample, caps: Caps | None = None) -> NDArray[np.intp]:
    """All nodes (n,), the best first: the first k are an optimum of (10) for k spots, for any k.

    (11) is a sum over nodes, and (12) of a node is  sum over pairs of max SDF - y_i Q_i:  every spot has the weight 1
    in the knapsack and the profit  sum over pairs of Q_i >= 0  whatever the others are, so the most profitable fill
    it. With caps the most profitable that still has room does: sets within caps are a matroid, where greedy is exact.
    """
    order = np.argsort(-sample.sums(), kind="stable")
    return order if caps is None else caps.fill(order)


def cost(sample: Sample, order: NDArray[np.intp]) -> tuple[Array, Array]:
    """Cost (11) with the first 0, 1, ... nodes of an order, per pair and node, and its standard error, (k + 1,) [1/m].

    CF / (P n) = mean over pairs of  [ n max SDF - sum over chosen i of Q_i ] / n.  The error is that of the mean over
    pairs, from their second moments.
    """
    P, n = sample.pairs, sample.nodes
    # in the space of (Q_1, ..., Q_n, max SDF), the cost of a pair is a dot product with c
    c = np.zeros((len(order) + 1, n + 1))
    c[:, n] = 1.0
    for k, i in enumerate(order):
        c[k + 1 :, i] = -1.0 / n
    means = np.append(sample.sums(), sample.peak.sum()) / P
    mean = c @ means
    variance = ((c @ sample.moments()) * c).sum(axis=1) - mean**2
    return mean, np.sqrt(np.maximum(variance, 0.0) / P)


def check_spots(spots: int, nodes: int, caps: Caps | None = None) -> None:
    """Refuse a number of spots that cannot be placed.

    Args:
        spots: How many are wanted.
        nodes: How many there are.
        caps: How many a group of nodes may have.

    Raises:
        ConfigurationError: Below 1, or more than there are nodes or caps allow.
    """
    if caps is not None and spots > caps.room():
        expected = f"at most {caps.room()}, what at_most of the regions adds up to"
        raise ConfigurationError("placement", "spots", spots, expected)
    if not (isinstance(spots, int | np.integer) and not isinstance(spots, bool) and 1 <= spots <= nodes):
        raise ConfigurationError("placement", "spots", spots, f"1 to {nodes}, the number of candidate nodes")
