"""Tables of what the commands of docs/data_commands.py have measured, for campaign_tables.py to fill pages with."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from statistics import median
from typing import Any

from noted import measured


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
    heads = ("experiment", "walking [m/s]", "contact", "at [s]", "smallest distance [mm]", "of links that move [mm]")
    heads += ("robot's fastest point at that time [m/s]", "closing [m/s]", "contact with the robot moving [s]")
    rows = [
        (
            run["experiment"],
            f"{run['speed']:.1f}",
            "no" if run["contact"] is None else "yes",
            f"{run['time'] if run['contact'] is None else run['contact']:.2f}",
            f"{1e3 * run['distance']:.0f}",
            f"{1e3 * run['moving_links']:.0f}",
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


def barrier() -> str:
    """What a cap on danger changes, a column a cap."""
    found = measured("barrier")
    rows = {
        "largest CDF_n": lambda f: f"{f['danger']:.1f}",
        "the same while the board stands still before the robot": lambda f: f"{f['danger_in_pause']:.2f}",
        "smallest distance robot-board": lambda f: f"{f['distance']:.3f} m",
        "largest norm of q̇": lambda f: f"{f['speed']:.1f} rad/s",
    }
    heads = ["", *("no cap" if cap == "none" else f"Δ_max = {cap}" for cap in found)]
    return lines(heads, [(what, *(show(f) for f in found.values())) for what, show in rows.items()])


def robots() -> str:
    """The first experiment, a line a robot."""
    heads = ("robot", "joints", "wire links", "regimes in order", "largest CDF_n", "limits held")
    heads += ("distance to the board gained: front, left, right", "kept")
    rows = []
    for row in measured("robots"):
        gained = ", ".join(f"{1e3 * metres:.0f}" for metres in row["gained"])
        limits, kept = ("yes" if row[key] else "no" for key in ("limits_held", "kept"))
        cells = (str(row["joints"]), str(row["links"]), "{} of {}".format(*row["in_order"]))
        rows.append((f"`{row['robot']}`", *cells, f"{row['peak']:.1f}", limits, f"{gained} mm", kept))
    return lines(heads, rows)


def walkers() -> str:
    """How soon a walker is in high danger, a line a speed."""
    rows = [
        (f"{speed} m/s", f"{found['at_rest']:.3f} s", f"{found['estimate']:.3f} s")
        for speed, found in measured("walkers")["walkers"].items()
    ]
    return lines(("walking", "at rest, as in the paper", "with the estimate"), rows)


TABLES: dict[str, Callable[[], str]] = {"path": path, "fast-person": fast_person, "pick": pick}
TABLES |= {"barrier": barrier, "robots": robots, "walkers": walkers}
