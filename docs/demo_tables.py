"""Tables of what the commands of docs/data_commands.py have measured, for campaign_tables.py to fill pages with."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

DATA = Path(__file__).resolve().parent / "data"


def measured(name: str) -> Any:
    """What docs/data/NAME.json says."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def lines(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    told = (f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows))
    return "\n".join(re.sub(r" {2,}\|", " |", line) for line in told)


def path() -> str:
    """The second experiment, a column a law."""
    found = measured("path")["laws"]
    rows: dict[str, Callable[[dict[str, Any]], str]] = {
        "orientation error on the line, low danger, constant speed [rad]": lambda f: f"{f['line_orientation']:.2g}",
        "position error there [mm]": lambda f: f"{1e3 * f['line_position']:.2f}",
        "position error in medium danger, path followed [mm]": lambda f: f"{1e3 * f['medium_position']:.2f}",
        "step of q̇ [a_max dt]": lambda f: f"{f['step']:.3f}",
        "ticks in which the law was clipped to the limits": lambda f: str(f["clipped"]),
        "joint speed on the way back [limit]": lambda f: f"{f['return_speed']:.3f}",
        "joint acceleration on the way back [limit]": lambda f: f"{f['return_acceleration']:.3f}",
        "the same from 0.5 s after high danger on [limit]": lambda f: f"{f['smooth_acceleration']:.3f}",
        "distance of the tool from where the path stopped, when it resumes [mm]": lambda f: (
            "-" if f["resumed"] is None else f"{1e3 * f['resumed']:.3f}"
        ),
        "suspensions": lambda f: str(f["suspensions"]),
        "progress along the path in 45 s [s]": lambda f: f"{f['travelled']:.1f}",
    }
    heads = ["largest figures", *(name.replace("nullspace", "null-space") for name in found)]
    return lines(heads, [[what, *(show(f) for f in found.values())] for what, show in rows.items()])


def fast_person() -> str:
    """Somebody walks straight at the robot, a line a run."""
    heads = ("experiment", "walking [m/s]", "contact", "at [s]", "smallest distance [mm]")
    heads += ("robot's fastest point at that time [m/s]", "closing [m/s]", "contact with the robot moving [s]")
    rows = [
        (
            run["experiment"],
            f"{run['speed']:.1f}",
            "no" if run["contact"] is None else "yes",
            f"{run['time'] if run['contact'] is None else run['contact']:.2f}",
            f"{1e3 * run['distance']:.0f}",
            f"{run['robot_speed']:.2f}",
            f"{run['closing_speed']:.2f}",
            f"{run['moving_contact']:.2f}",
        )
        for run in measured("fast-person")
    ]
    return lines(heads, rows)


def pick() -> str:
    """The third experiment: nobody, the nominal day, many days."""
    found = measured("pick")
    alone, runs, cost = found["without_people"], found["runs"], found["cost_per_cycle"]
    first = runs[0]

    def all_of(key: str, text: str = "{}") -> str:
        low, high = min(run[key] for run in runs), max(run[key] for run in runs)
        return f"{text.format(low)} each" if low == high else f"{text.format(low)} to {text.format(high)}"

    def smallest(key: str, scale: float, digits: int) -> str:
        worst = min(runs, key=lambda run: run[key])
        middle = scale * median(run[key] for run in runs)
        return f"{scale * worst[key]:.{digits}f} (seed {worst['seed']}), median of the seeds {middle:.{digits}f}"

    def row(what: str, key: str, show: Callable[[Any], str], spread: str) -> tuple[str, ...]:
        return what, show(alone[key]), show(first[key]), spread

    times = sorted(run["duration"] for run in runs)
    rows = [
        row("screws delivered", "delivered", str, all_of("delivered")),
        row("missed", "missed", str, all_of("missed")),
        row("lost", "lost", str, all_of("lost")),
        ("taken and placed by people", "-", f"{first['taken']}, {first['placed']}",
         f"{all_of('taken')}, {all_of('placed')}"),
        row("all ten cycles [s]", "duration", "{:.1f}".format,
            f"median {median(times):.1f}, range {times[0]:.1f} to {times[-1]:.1f}"),
        ("cost of people [s per cycle]", "-", f"{(first['duration'] - alone['duration']) / 10:.2f}",
         f"median {cost['median']:.2f}, quartiles {cost['quartile_1']:.2f} and {cost['quartile_3']:.2f}, "
         f"range {cost['smallest']:.2f} to {cost['largest']:.2f}"),
        ("ticks with contact robot-person while the robot moves", "-", str(first["contacts"]), all_of("contacts")),
        ("smallest distance robot-person [m]", "-", f"{first['nearest']:.3f}", smallest("nearest", 1.0, 3)),
        row("smallest distance robot-furniture [mm]", "clearance", lambda metres: f"{1e3 * metres:.1f}",
            smallest("clearance", 1e3, 1)),
        row("largest CDF_n", "danger", "{:.1f}".format, all_of("danger", "{:.1f}")),
        row("suspensions", "suspensions", str, all_of("suspensions")),
    ]  # fmt: skip
    return lines(("", "nobody", "seed 0", f"seeds 0 to {len(runs) - 1}"), rows)


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


def share(probability: float, low: float, high: float) -> str:
    """A share and its limits in per cent."""
    return f"{100 * probability:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def place_arrays() -> str:
    """Spots and arrays as they are bundled, and fewer arrays, by detection and by the nearest part."""
    judged = {name: measured(f"place-{name}") for name in ("caps", "arrays")}
    keys = (("probability", "low", "high"), ("nearest", "nearest_low", "nearest_high"))

    def bundled(what: str, found: dict[str, Any]) -> tuple[str, ...]:
        own = found["placements"][found["wanted"]]["independent_sample"]
        return what, *(share(*(own[key] for key in three)) for three in keys), f"{100 * own['danger']:.0f} %"

    rows = [bundled("20 Sharps, as bundled", judged["caps"])]
    for objective, counts in (("detection", (8, 12, 20)), ("nearest", (8, 12))):
        curve = judged["arrays"]["curves"][objective]
        for k in counts:
            seen = share(curve["probability"][1][k], *(side[k] for side in curve["confidence"]))
            near = share(curve["nearest"][1][k], *(side[k] for side in curve["nearest_confidence"]))
            rows.append((f"{k} arrays by `{objective}`", seen, near, f"{100 * curve['danger'][1][k]:.0f} %"))
    rows.append(bundled("20 arrays by `nearest`, as bundled", judged["arrays"]))
    return lines(("sensors", "detected", "nearest part seen", "danger measured"), rows)


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


def camera_calibration() -> str:
    """How well simulated cameras are found, a line a robot."""
    rows = []
    for robot, found in measured("camera-calibration")["robots"].items():
        good = [run for run in found if run["good"]]
        cells = [
            f"{median(run[key] for run in good):{form}} ({max(run[key] for run in good):{form}}) {unit}"
            for key, form, unit in (("place", ".0f", "mm"), ("angle", ".2f", "°"), ("middle", ".1f", "mm"))
        ]
        rows.append((f"`{robot}`", *cells, f"{len(good)} of {len(found)}"))
    return lines(("robot", "camera's place", "its direction", "a place at the robot", "called good"), rows)


TABLES = {"path": path, "fast-person": fast_person, "pick": pick, "compare": compare, "place": place, "bench": bench}
TABLES |= {"hqp-random": hqp_random, "hqp-drift": hqp_drift, "late": late, "camera-calibration": camera_calibration}
TABLES |= {"place-arrays": place_arrays}
