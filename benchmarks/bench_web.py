"""How long ticks take behind the page, without and with a browser that shows it, and how soon a drag reaches the robot.

    python benchmarks/bench_web.py docs/data/web.json [--seconds 60] [--fifo]

The simulation has a core of its own, page and browser share the others, if the machine has any. WebGL is software
here: a browser with a graphics card is quicker. `--fifo` asks for SCHED_FIFO for the simulation, in both runs, where
others are at work on the machine.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from browser import WIDE, Program, Tab, chromium, launched

from qpsafe.irc5.process.latency import Latency
from qpsafe.sim.web.app import App
from qpsafe.sim.web.people import PERSON, Drag
from qpsafe.sim.web.process import LiveProcess
from qpsafe.sim.web.server import Page
from qpsafe.sim.web.setup import Setup
from qpsafe.sim.web.view import Looks
from qpsafe.text.json_text import json_text

ARROW, END = (1.85, 0.5, 0.0), (1.1, 0.5, 0.0)
SETTLE = 5.0  # before it is measured [s]


def shared_out(process: int, fifo: bool) -> None:
    """Give the simulation a core of its own, and this process the others."""
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) > 1:
        os.sched_setaffinity(process, cores[:1])
        os.sched_setaffinity(0, cores[1:])
    if fifo:
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(50))


def summary(pairs: np.ndarray) -> dict[str, Any]:
    """Figures of ticks: of the controller, and of all that a tick does, lateness included [s]."""
    found: dict[str, Any] = {"ticks": len(pairs), "late": int((pairs[:, 1] > 0.004).sum())}
    for name, times in zip(("tick", "cycle"), pairs.T, strict=True):
        latency = Latency()
        for seconds in times:
            latency.record(float(seconds))
        found[name] = {key: latency.summary()[key] for key in ("p50", "p99.9", "maximum")}
    return found


def drags(k: int) -> Drag:
    """Somebody who walks to and fro before the robot."""
    return Drag(PERSON, (1.1 + 0.35 * float(np.cos(0.02 * k)), 0.3, 0.0), 2.0)


def without(seconds: float, fifo: bool) -> dict[str, Any]:
    """The simulation alone; wishes come as from a page."""
    live, found = LiveProcess(Setup(), Path(tempfile.mkdtemp())), []
    shared_out(live.number, fifo)
    from qpsafe.sim.web.live import Wish

    frames, begin, k = [], 0.0, 0
    while not begin or time.monotonic() < begin + SETTLE + seconds:
        frames = live.frames.received(0.03)
        begin = begin or (time.monotonic() if frames else 0.0)
        k += 1
        live.wishes.offer(Wish(k, drag=drags(k)))
        if time.monotonic() > begin + SETTLE:
            found += [frame.times for frame in frames]
    live.close()
    return summary(np.vstack(found))


def beside(path: str, seconds: float, fifo: bool) -> dict[str, Any]:
    """The same with the page open in Chromium."""
    page = Page("127.0.0.1", 0, "bench")
    app = App(Setup(), page, Path(tempfile.mkdtemp()), Looks(shadows=False))
    shared_out(app.live.number, fifo)
    found, keep, over = [], threading.Event(), threading.Event()
    take, k = app.view.take, 0

    def taken(frame: Any) -> None:
        if keep.is_set():
            found.append(frame.times)
        take(frame)

    app.view.take = taken  # type: ignore[method-assign]

    def show() -> None:
        with launched(path) as browser:
            Tab(browser, page.address, WIDE)
            time.sleep(SETTLE)
            keep.set()
            time.sleep(seconds)
            over.set()

    visitor = threading.Thread(target=show)
    visitor.start()
    while not over.is_set():
        app.turn()
        k += 1
        app.wishes.change(drag=drags(k))
    visitor.join()
    app.close()
    page.close()
    return summary(np.vstack(found))


def delays(path: str, count: int) -> dict[str, Any]:
    """How soon drags reach the robot [s]."""
    program = Program(["web", "--no-shadows", "--port", "0"], Path(tempfile.mkdtemp()))
    try:
        with launched(path) as browser:
            found = np.array(Tab(browser, program.address, WIDE).drag_delays(ARROW, END, count))
    finally:
        program.interrupt()
    return {"count": count, "median": float(np.median(found)), "p90": float(np.percentile(found, 90.0))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--drags", type=int, default=60)
    parser.add_argument("--fifo", action="store_true")
    given = parser.parse_args()
    path = chromium()
    if path is None:
        raise SystemExit("bench_web: needs Chromium")
    every = os.sched_getaffinity(0)
    found: dict[str, Any] = {"seconds": given.seconds, "fifo": given.fifo, "cores": os.cpu_count()}
    found |= {"python": platform.python_version(), "load": os.getloadavg()[0]}
    found["without"] = without(given.seconds, given.fifo)
    os.sched_setaffinity(0, every)
    found["with"] = beside(path, given.seconds, given.fifo)
    os.sched_setaffinity(0, every)
    found["drag"] = delays(path, given.drags)
    given.out.write_text(json_text(found) + "\n", encoding="utf-8")
    print(json_text(found))


if __name__ == "__main__":
    main()
