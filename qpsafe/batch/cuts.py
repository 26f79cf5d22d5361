"""How the blocks of a batch are cut into arrays, in Python and in compiled code."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from qpsafe.batch.blocks import Own, Shared, Work
from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view


def shared(floats: Any, integers: Any, at: Any, sizes: Any) -> Shared:
    """Cut `Shared`.

    Args:
        floats: A block of floats.
        integers: A block of integers.
        at: Where each array begins.
        sizes: As `code` names them.
    """
    n, N, T, k, R, L, K, E = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5], sizes[6], sizes[7]
    return Shared(
        view(floats, at[0], (19,)),
        view(floats, at[1], (L, 4)),
        view(floats, at[2], (N, 4, 4)),
        view(floats, at[3], (N,)),
        view(floats, at[4], (4, n)),
        view(floats, at[5], (4, n)),
        view(floats, at[6], (k,)),
        view(floats, at[7], (T,)),
        view(floats, at[8], (K,)),
        view(floats, at[9], (K, 28)),
        view(floats, at[10], (E,)),
        view(integers, at[11], (9,)),
        view(integers, at[12], (L,)),
        view(integers, at[13], (N,)),
        view(integers, at[14], (R,)),
        view(integers, at[15], (N,)),
        view(integers, at[16], (N,)),
        view(integers, at[17], (N,)),
        view(integers, at[18], (T,)),
        view(integers, at[19], (T + 1,)),
        view(integers, at[20], (T + 1,)),
        view(integers, at[21], (n,)),
        view(integers, at[22], (n + 2,)),
        view(floats, at[23], (N + 1,)),
        view(floats, at[24], (sizes[12],)),
        view(integers, at[25], (sizes[13],)),
        view(floats, at[26], (sizes[17],)),
        view(integers, at[27], (sizes[18],)),
    )


def own(floats: Any, integers: Any, at: Any, sizes: Any) -> Own:
    """Cut `Own`.

    Args:
        floats: A block of floats.
        integers: A block of integers.
        at: Where each array begins.
        sizes: As `code` names them.
    """
    n, N, T, k, R = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    return Own(
        view(floats, at[0], (n,)),
        view(floats, at[1], (n,)),
        view(floats, at[2], (n,)),
        view(floats, at[3], (n,)),
        view(floats, at[4], (3,)),
        view(floats, at[5], (N, 2)),
        view(floats, at[6], (3, N, 6)),
        view(floats, at[7], (2,)),
        view(floats, at[8], (3, n)),
        view(floats, at[9], (n,)),
        view(floats, at[10], (3, N)),
        view(floats, at[11], (n,)),
        view(floats, at[12], (N, 4, 4)),
        view(floats, at[13], (N, 6)),
        view(floats, at[14], (k, 5)),
        view(floats, at[15], (k, 4)),
        view(floats, at[16], (k, 10)),
        view(floats, at[17], (3,)),
        view(floats, at[18], (N,)),
        view(floats, at[19], (n,)),
        view(floats, at[20], (R,)),
        view(integers, at[21], (24,)),
        view(integers, at[22], (N, 3)),
        view(integers, at[23], (3,)),
        view(integers, at[24], (5,)),
        view(integers, at[25], (T,)),
        view(integers, at[26], (T, 2)),
        view(integers, at[27], (k, 3)),
        view(integers, at[28], (k,)),
        view(integers, at[29], (k,)),
        view(floats, at[30], (sizes[19],)),
        view(floats, at[31], (5,)),
    )


def work(floats: Any, integers: Any, at: Any, sizes: Any, room: int) -> Work:
    """Cut `Work`.

    Args:
        floats: A block of floats.
        integers: A block of integers.
        at: Where each array begins.
        sizes: As `code` names them.
        room: For how many points.
    """
    n, N, T, R, memory, links = sizes[0], sizes[1], sizes[2], sizes[4], sizes[8], sizes[9]
    soft = sizes[16]
    rows = max(R, n) + n + soft
    return Work(
        view(floats, at[0], (memory + 12 * links + n + 3 * room,)),
        view(floats, at[1], (room, 3)),
        view(floats, at[2], (room,)),
        view(floats, at[3], (room, 3)),
        view(floats, at[4], (memory,)),
        view(floats, at[5], (26 * N + 2 + 2 * n,)),
        view(floats, at[6], (28 + 2 * n,)),
        view(floats, at[7], (sizes[10],)),
        view(floats, at[8], (rows, n)),
        view(floats, at[9], (2, rows)),
        view(floats, at[10], (R * n + 2 * R + (4 + N) * n,)),
        view(floats, at[11], (n * n + 2 * n + 5 * n,)),
        view(floats, at[12], (N, 4, 4)),
        view(floats, at[13], (T, 4, 4)),
        view(floats, at[14], (T, 6)),
        view(floats, at[15], (N, 6)),
        view(floats, at[16], (2, n)),
        view(floats, at[17], (n,)),
        view(floats, at[18], (N,)),
        view(floats, at[19], (3,)),
        view(floats, at[20], (N, 2)),
        view(floats, at[21], (2, N, 6)),
        view(floats, at[22], (2,)),
        view(floats, at[23], (2, n)),
        view(floats, at[24], (6 + n,)),
        view(floats, at[25], (6 + n,)),
        view(floats, at[26], (n,)),
        view(floats, at[27], (1, 4, 4)),
        view(integers, at[28], (room,)),
        view(integers, at[29], (sizes[11],)),
        view(integers, at[30], (N + 2,)),
        view(integers, at[31], (3 * n + (N + 1) * (3 + 2 * n + R + soft),)),
        view(integers, at[32], (3 * n + 2 * (3 + 3 * n + soft),)),
        view(integers, at[33], (3, n)),
        view(integers, at[34], (N, 3)),
        view(integers, at[35], (3,)),
        view(floats, at[36], (sizes[14],)),
        view(floats, at[37], (N + 2,)),
        view(integers, at[38], (sizes[15],)),
        view(integers, at[39], (3,)),
        view(floats, at[40], (sizes[20] + (sizes[21] + 1) * room,)),
        view(integers, at[41], (sizes[21] * room + 3,)),
    )


cut_shared, cut_own, cut_work = inline(shared), inline(own), inline(work)


def lay_out(cut: Callable[..., Any], *sizes: Any) -> tuple[np.ndarray, int, int]:
    """Where each array of a cut begins, and how many floats and integers there are.

    Args:
        cut: One of `shared`, `own`, `work`.
        sizes: As it takes them.
    """
    at = np.zeros(64, dtype=np.int64)  # cut from blocks that are long enough, all from the start
    arrays = cut(np.empty(1 << 26, np.uint8), np.empty(1 << 26, np.int8), at, *sizes)
    length = [0, 0]
    for k, array in enumerate(arrays):
        whole = array.dtype == np.int8
        at[k] = length[whole]
        length[whole] += prod(array.shape)
    return at[: len(arrays)], length[0], length[1]
