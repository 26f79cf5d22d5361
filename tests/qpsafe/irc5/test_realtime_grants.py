"""What is asked of the system is granted, or refused in one clear line; the loop runs either way."""

import gc
import subprocess
import sys

import pytest

from qpsafe.irc5.process import realtime


def fresh(code: str) -> str:
    """What a fresh interpreter prints: none of this is to be tried on the tests' own process."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for its scheduler and its locked memory")
def test_every_answer_is_one_line_and_matches_the_system() -> None:
    code = (
        "import os\n"
        "from qpsafe.irc5.process.realtime import fifo, lock_memory\n"
        "a, b = fifo(7), lock_memory()\n"
        "print(a.granted == (os.sched_getscheduler(0) == os.SCHED_FIFO), b.granted, sep='\\n')\n"
        "print(a.line, b.line, sep='\\n')\n"
        "locked = [line for line in open('/proc/self/status') if line.startswith('VmLck')]\n"
        "print(int(locked[0].split()[1]) > 0)\n"
    )
    agrees, granted, fifo_line, lock_line, locked = fresh(code).split("\n")
    assert agrees == "True"
    assert granted == locked
    assert "SCHED_FIFO" in fifo_line
    assert ("not permitted" in lock_line) == (granted == "False")


def test_an_impossible_priority_is_refused_in_words() -> None:
    grant = realtime.fifo(1000)
    assert not grant.granted
    assert "normal priority" in grant.line


def test_one_thread_before_numpy_and_not_after() -> None:
    code = (
        "import sys\n"
        "from qpsafe.irc5.process.realtime import one_thread\n"
        "print(one_thread().granted)\n"
        "import numpy, numba\n"
        "print(numba.config.NUMBA_NUM_THREADS)\n"
        "print(one_thread().granted)\n"
        "import os; del os.environ['OMP_NUM_THREADS']\n"
        "print(one_thread().granted)\n"
    )
    assert fresh(code).split() == ["True", "1", "True", "False"]


def test_what_is_alive_is_frozen() -> None:
    here = gc.get_freeze_count()
    code = (
        "import gc\n"
        "from qpsafe.irc5.process.realtime import freeze_garbage\n"
        "grant = freeze_garbage()\n"
        "print(gc.get_freeze_count() > 1000, gc.isenabled(), grant.granted)"
    )
    assert fresh(code).split() == ["True", "True", "True"]
    assert gc.get_freeze_count() == here


@pytest.mark.skipif(sys.platform != "linux", reason="Linux's timer slack")
def test_sleeps_end_when_they_should() -> None:
    code = (
        "import ctypes\n"
        "from qpsafe.irc5.process.realtime import fine_timers\n"
        "fine_timers()\n"
        "print(ctypes.CDLL(None).prctl(30, 0, 0, 0, 0))"  # PR_GET_TIMERSLACK [ns]
    )
    assert fresh(code) == "1"


def test_memory_in_use_is_told() -> None:
    assert realtime.resident() > 1_000_000 or sys.platform != "linux"
