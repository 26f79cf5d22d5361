"""What an ordinary Linux grants a loop that must not be late; each item is asked for, and said plainly if refused."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from contextlib import suppress
from typing import NamedTuple

#: Read by the libraries when they are loaded: one thread each, no pool that wakes up beside the loop.
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
_CURRENT, _FUTURE = 1, 2  # MCL_CURRENT, MCL_FUTURE of sys/mman.h
_TIMER_SLACK = 29  # PR_SET_TIMERSLACK of sys/prctl.h


class Grant(NamedTuple):
    """Whether something was granted, in a line."""

    name: str
    granted: bool
    line: str


def one_thread() -> Grant:
    """One thread for numerics; to be called before numpy is loaded."""
    late = "numpy" in sys.modules and not all(os.environ.get(name) == "1" for name in THREAD_VARIABLES[:2])
    for name in THREAD_VARIABLES:
        os.environ[name] = "1"
    if late:
        return Grant("threads", False, "one thread for numerics: too late, numpy is already loaded")
    return Grant("threads", True, "one thread for numerics")


def fifo(priority: int, thread: int = 0) -> Grant:
    """The real-time scheduler SCHED_FIFO, for a thread by its number; 0: for the one that asks."""
    if not hasattr(os, "sched_setscheduler"):
        return Grant("fifo", False, f"SCHED_FIFO: not available on {sys.platform}; normal priority")
    try:
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, ValueError) as error:
        reason = f"SCHED_FIFO {priority}: not permitted ({error}); normal priority"
        return Grant("fifo", False, reason + "; needs CAP_SYS_NICE, or a line 'rtprio' in /etc/security/limits.conf")
    return Grant("fifo", True, f"SCHED_FIFO at priority {priority}")


def lock_memory() -> Grant:
    """All pages in memory, now and later (mlockall), so that none must be fetched from the disk."""
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mlockall(_CURRENT | _FUTURE) != 0
        reason = os.strerror(ctypes.get_errno())
    except (OSError, AttributeError, TypeError):
        failed, reason = True, f"not available on {sys.platform}"
    if failed:
        needs = "needs CAP_IPC_LOCK, or a line 'memlock' in /etc/security/limits.conf"
        return Grant("mlockall", False, f"mlockall: not permitted ({reason}); {needs}")
    return Grant("mlockall", True, "memory locked (mlockall)")


def freeze_garbage() -> Grant:
    """Everything that is alive now is never searched for garbage again; what comes later still is, and is little."""
    gc.collect()
    gc.freeze()
    return Grant("gc", True, f"garbage collector: {gc.get_freeze_count()} objects frozen")


def fine_timers() -> None:
    """Let this thread's sleeps end when they should, not up to 50 µs later (Linux)."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(_TIMER_SLACK, 1, 0, 0, 0)


def resident() -> int:
    """Memory of this process that is in RAM [byte]; 0 where it cannot be told."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0
