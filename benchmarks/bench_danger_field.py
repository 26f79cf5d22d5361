"""Time of one danger-field evaluation: value and gradient at 20 points for 6 links, through the public `evaluate`."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from qpsafe.cli.outputs import try_file
from qpsafe.danger.field import DangerField
from qpsafe.robot.wire import Wire
from qpsafe.text.json_text import json_text

POINTS, LINKS, GOAL_US = 20, 6, 40.0


def bench(repeats: int = 20_000, seed: int = 0) -> dict[str, object]:
    """Return the latency of `evaluate` [µs], compilation excluded, over points and velocities that change every call.

    The links have lengths and speeds like an IRB 140's, none is of length zero (those are cheaper), and the points are
    spread over 2 m around them.
    """
    rng = np.random.default_rng(seed)
    field = DangerField()
    joints = np.cumsum(rng.uniform(-0.4, 0.4, (LINKS + 1, 3)), axis=0)
    points = rng.uniform(-1.0, 1.0, (64, POINTS, 3))
    velocities = rng.normal(size=(64, LINKS + 1, 3))
    calls = [(p, Wire(joints[:-1], joints[1:], v[:-1], v[1:])) for p, v in zip(points, velocities, strict=True)]
    for arguments in calls:
        field.evaluate(*arguments)
    elapsed = np.empty(repeats)
    for k in range(repeats):
        arguments = calls[k % len(calls)]
        start = time.perf_counter_ns()
        field.evaluate(*arguments)
        elapsed[k] = 1e-3 * (time.perf_counter_ns() - start)
    median, p99 = np.percentile(elapsed, [50, 99])
    return {
        "name": "danger field, value and gradient",
        "points": POINTS,
        "links": LINKS,
        "repeats": repeats,
        "median_us": float(median),
        "p99_us": float(p99),
        "max_us": float(elapsed.max()),
        "goal_us": GOAL_US,
        "ok": bool(median <= GOAL_US),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=20_000)
    parser.add_argument("--out", type=Path, help="write the result to this file")
    arguments = parser.parse_args()
    if arguments.out:
        try_file("bench_danger_field", "--out", arguments.out)
    result = bench(arguments.repeats)
    print(f"{result['name']}: {POINTS} points x {LINKS} links, {result['repeats']} calls")
    print(f"  median {result['median_us']:.1f} µs   p99 {result['p99_us']:.1f} µs   max {result['max_us']:.1f} µs")
    print(f"  goal: median <= {GOAL_US:.0f} µs: {'met' if result['ok'] else 'missed'}")
    if arguments.out:
        arguments.out.write_text(json_text(result) + "\n")


if __name__ == "__main__":
    main()
