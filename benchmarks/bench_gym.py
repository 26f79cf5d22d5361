"""How many steps of the encounters' environment a second has: python benchmarks/bench_gym.py [FILE.json].

Processor time of one environment, resets included; wall time of four in one process, and of four in processes of their
own.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import gymnasium
import numpy as np

import qpsafe.sim.campaign.gym.environment  # noqa: F401  which registers it
from qpsafe.text.json_text import json_text

NAME, STEPS = "qpsafe/Encounter-v0", 10_000


def alone() -> float:
    """Steps of one environment a second of processor time."""
    env = gymnasium.make(NAME)
    env.reset(seed=0)
    still, begin = np.zeros(env.action_space.shape), time.process_time()
    for _ in range(STEPS):
        *_, terminated, truncated, _ = env.step(still)
        if terminated or truncated:
            env.reset()
    return STEPS / (time.process_time() - begin)


def together(mode: str) -> float:
    """Steps of four environments a second of wall time.

    Args:
        mode: Of gymnasium's vectors, "sync" or "async".
    """
    many = gymnasium.make_vec(NAME, num_envs=4, vectorization_mode=mode)
    many.reset(seed=0)
    still = np.zeros(many.action_space.shape)
    many.step(still)
    begin = time.perf_counter()
    for _ in range(STEPS // 4):
        many.step(still)
    spent = time.perf_counter() - begin
    many.close()
    return STEPS / spent


def main() -> None:
    """Print and write it."""
    alone()  # compiles
    found = {"alone": alone(), "sync": together("sync"), "async": together("async")}
    print({name: round(value) for name, value in found.items()})
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
