"""The watchdog asks when heartbeats stop, and insists when nobody answers; no timing is judged, waits are wide."""

import os
import signal
import subprocess
import sys
import time

import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.process.watchdog import Watchdog

pytestmark = pytest.mark.long


def until(condition, seconds: float = 30.0) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return condition()


def test_it_asks_once_the_heartbeat_stops_and_not_before_the_first() -> None:
    with Watchdog(limit=0.05, grace=3000.0) as watchdog:
        assert watchdog.alive
        time.sleep(0.3)
        assert watchdog.asked == 0.0  # no heartbeat yet: nothing to watch
        watchdog.beat()
        assert until(lambda: watchdog.asked > 0.0)
        assert watchdog.asked > 0.05
        assert watchdog.worst >= watchdog.asked
        watchdog.beat()
        watchdog.acknowledge()
        assert until(lambda: watchdog.asked > 0.0)  # again
        process = watchdog._process
    assert process is not None
    assert process.poll() is not None


def test_it_kills_a_loop_that_hangs() -> None:
    code = (
        "import time\n"
        "from qpsafe.irc5.process.watchdog import Watchdog\n"
        "with Watchdog(limit=0.05, grace=0.2) as watchdog:\n"
        "    watchdog.beat()\n"
        "    time.sleep(120)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == -signal.SIGKILL
    assert "no heartbeat" in done.stderr


def test_it_ends_with_the_loop() -> None:
    code = (
        "from qpsafe.irc5.process.watchdog import Watchdog\n"
        "import os\n"
        "watchdog = Watchdog(limit=0.05, grace=3000.0).__enter__()\n"
        "print(watchdog._process.pid, flush=True)\n"
        "os._exit(0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    child = int(done.stdout)

    def gone() -> bool:
        try:
            with open(f"/proc/{child}/stat", encoding="ascii") as file:
                return file.read().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            return not os.path.exists(f"/proc/{child}")

    assert until(gone)


@pytest.mark.parametrize("times", [(0.0, 1.0), (0.1, -1.0), (float("nan"), 1.0)])
def test_wrong_times_are_named(times: tuple[float, float]) -> None:
    with pytest.raises(ConfigurationError, match="Watchdog"):
        Watchdog(*times)


def trouble(watchdog: Watchdog) -> str:
    return watchdog.trouble(time.monotonic())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_its_death_is_told_with_the_signal(number: int) -> None:
    with Watchdog(limit=1.0, grace=3000.0) as watchdog:
        assert trouble(watchdog) == ""
        assert watchdog._process is not None
        os.kill(watchdog._process.pid, number)
        assert until(lambda: bool(trouble(watchdog)))
        assert signal.Signals(number).name in trouble(watchdog)


def test_a_watchdog_that_stands_still_is_told_of_and_one_that_goes_on_is_not() -> None:
    with Watchdog(limit=1.0, grace=3000.0) as watchdog:
        assert watchdog._process is not None
        os.kill(watchdog._process.pid, signal.SIGSTOP)
        assert until(lambda: "stood still" in trouble(watchdog))
        os.kill(watchdog._process.pid, signal.SIGCONT)
        assert until(lambda: trouble(watchdog) == "")


def test_a_loop_that_was_itself_suspended_does_not_take_that_for_a_dead_watchdog() -> None:
    with Watchdog(limit=1.0, grace=3000.0) as watchdog:
        assert watchdog._process is not None
        os.kill(watchdog._process.pid, signal.SIGSTOP)  # both were, say
        assert watchdog.trouble(100.0) == ""
        assert watchdog.trouble(100000.0) == ""


def test_what_ends_other_processes_does_not_end_it_while_the_loop_brakes() -> None:
    with Watchdog(limit=1.0, grace=3000.0) as watchdog:
        process = watchdog._process
        assert process is not None
        assert os.getsid(process.pid) != os.getsid(0)  # a terminal's signals do not even reach it
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
            os.kill(process.pid, number)
        pulse = watchdog._places[3]
        assert until(lambda: watchdog._places[3] > pulse + 2)
        assert watchdog.alive
    assert process.poll() is not None


def test_a_watchdog_that_does_not_start_is_an_error_before_anything_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(ConfigurationError, match="process"), Watchdog():
        pass


def test_it_kills_a_loop_that_hangs_though_nobody_reads_what_it_says() -> None:
    """With a full pipe for its words: to speak first, it would have waited for ever."""
    code = (
        "import os, time\n"
        "from qpsafe.irc5.process.watchdog import Watchdog\n"
        "with Watchdog(limit=0.05, grace=0.2) as watchdog:\n"
        "    os.set_blocking(2, False)\n"
        "    try:\n"
        "        while True: os.write(2, b'x' * 4096)\n"
        "    except BlockingIOError: os.set_blocking(2, True)\n"
        "    watchdog.beat()\n"
        "    time.sleep(120)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    assert process.wait(timeout=60) == -signal.SIGKILL
    assert process.stderr is not None
    process.stderr.close()
