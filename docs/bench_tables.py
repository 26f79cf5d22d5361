"""Tables of what laws, solvers, placements and the wire do, and how long it takes, for campaign_tables.py."""

from __future__ import annotations

from typing import Any

from demo_tables import lines
from noted import measured


def compare() -> str:
    """How near the paper's law and its QP form are."""
    found = measured("compare")
    states, loop = found["states"], found["closed_loop"]
    count = f"{found['sample']['states']:,}"
    rows = []
    for what, name in (
        (f"{count} random states, no limits [rad/s]", "paper"),
        ("the same with inactive limits [rad/s]", "paper, limits inactive"),
    ):
        kinds = states[name].values()
        middle = [kind["median"] for kind in kinds]
        rows.append((what, f"{max(k['worst'] for k in kinds):.1e}", f"{min(middle):.1e} to {max(middle):.1e}"))
    long = f"joint trajectories over {loop['duration']:.0f} s, limits off [rad]"
    rows.append((long, f"{loop['trajectory_deviation']:.1e}", ""))
    return lines(("", "worst", "median of each of the 18 kinds"), rows)


def projection() -> str:
    """What the paper's projection leaves of the low-priority task, a line a kind of state."""
    names = {"independent": "3 + 3 random rows, n = 6, 7, 9", "irb140": "IRB 140 anywhere"}
    names |= {f"irb140, {what}": f"IRB 140, {what}" for what in ("wrist singular", "arm stretched")}
    found = measured("projection")
    rows = []
    for kind, name in names.items():
        paper, strict = found[kind]["paper"], found[kind]["strict"]
        cells = (paper["median"], strict["median"], strict["worst"])
        rows.append(
            (name, str(paper["states"]), *(f"{x:.0e}" if x < 1e-3 else f"{x:.{1 if x < 10.0 else 0}f}" for x in cells))
        )
    return lines(("states", "how many", "paper: median", "strict: median", "strict: worst"), rows)


def place() -> str:
    """Twenty spots by each objective, judged on pairs that they were not chosen for."""
    names = {"cost": "`cost`, (10) to (12)"}
    rows = []
    for name, found in measured("place")["placements"].items():
        fair, own = found["independent_sample"], found["optimised_sample"]
        rows.append(
            (
                names.get(name, f"`{name}`, {found['method']}"),
                f"{fair['probability']:.1%} ({own['probability']:.1%})".replace("%", " %"),
                f"{100 * fair['low']:.1f} to {100 * fair['high']:.1f}",
                f"{100 * fair['danger']:.0f} %",
            )
        )
    return lines(("20 spots by", "detected", "95 %", "danger measured"), [*rows, ("the paper", "89 %", "", "")])


def bench() -> str:
    """What a tick takes, and of mink's."""
    tick = "whole tick, 20 distances"
    mink, pink = (f"{name}.solve_ik + daqp: frame, posture, limits" for name in ("mink", "pink"))
    names = {
        tick: f"{tick}: what a robot with its own sensors runs",
        f"{tick}, garbage collector on": "the same, garbage collector on",
        f"{tick}, collector on after gc.freeze": "the same after `gc.freeze`",
        "whole tick, 20 points given": "whole tick, 20 points given instead",
        f"{tick}, a task of one's own": f"{tick}, the position task somebody's own",
        f"{tick}, paper's projection": "the paper's projection",
        f"{tick}, weighted law": "the weighted law",
        f"{tick}, null-space law": "the null-space law, clipped in high danger, which is said",
        "danger field, 20 points x 6 links": "of it: danger field",
        "sensing, 20 spots, all filters": "of it: sensing",
        mink: "`mink.solve_ik` with daqp: frame, posture, limits",
        pink: "`pink.solve_ik`, the same",
    }
    found = measured("ticks")["results"]
    rows = []
    for name, what in names.items():
        row = found[name]
        spread = "" if name == mink else f" ({row['ratio_low']:.2f} to {row['ratio_high']:.2f})"
        rows.append((what, f"{1e6 * row['median']:.3g}", f"{row['ratio']:.2f}{spread}"))
    return lines(("what", "median [µs]", "of mink (quartiles)"), rows)


HQP = ("solver", "median µs", "p99", "best max", "wrong", "worse", "bad", "not repeated", "largest error")


def _solvers(rows: list[dict[str, Any]]) -> str:
    keys = (("median_us", ".1f"), ("p99_us", ".1f"), ("best_max_us", ".0f"), ("wrong", "d"), ("worse", "d"))
    keys += (("bad_status", "d"), ("not_repeated", "d"), ("largest_error", ".0e"))
    return lines(HQP, [(row["solver"], *(format(row[key], form) for key, form in keys)) for row in rows])


def hqp_random() -> str:
    """Hierarchical solvers on random problems."""
    return _solvers(measured("hqp-solvers")["random"])


def hqp_drift() -> str:
    """The same on a drifting sequence."""
    return _solvers(measured("hqp-solvers")["drift"])


def late() -> str:
    """How late answers are, a line a run."""
    rows = []
    for run in measured("stream")["results"]:
        stream, response = run["stream"], run["stream"]["response"]
        parts = stream["missed_parts"]
        rows.append(
            (
                str(run["busy"]),
                f"{stream['answered_in_time']} of {stream['packets']}",
                *(str(count) for count in parts.values()),
                *(f"{1e3 * response[key]:.2f} ms" for key in ("p50", "p99", "p99.9", "maximum")),
            )
        )
    names = [str(name).replace("_", " ") for name in measured("stream")["results"][0]["stream"]["missed_parts"]]
    return lines(("busy processes", "in time", *names, "p50", "p99", "p99.9", "maximum"), rows)


TABLES = {"compare": compare, "projection": projection, "place": place, "bench": bench, "late": late}
TABLES |= {"hqp-random": hqp_random, "hqp-drift": hqp_drift}
