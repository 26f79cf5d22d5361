"""The watchdog asks when heartbeats stop, and insists when nobody answers; no timing is judged, waits are wide."""

import os
import signal
import subprocess
import sys
import time

import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.watchdog import Watchdog


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
        "from qpsafe.irc5.watchdog import Watchdog\n"
        "with Watchdog(limit=0.05, grace=0.2) as watchdog:\n"
        "    watchdog.beat()\n"
        "    time.sleep(120)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == -signal.SIGKILL
    assert "no heartbeat" in done.stderr


def test_it_ends_with_the_loop() -> None:
    code = (
        "from qpsafe.irc5.watchdog import Watchdog\n"
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
