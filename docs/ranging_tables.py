"""Tables of what arrays and cameras see, for campaign_tables.py."""

from __future__ import annotations

from statistics import median
from typing import Any

from demo_tables import lines
from noted import measured

#: What tells a controller where people are, in words.
SEES = {
    "ideal": "20 ideal spots",
    "sharp": "20 Sharps",
    "vl53l5cx": "20 arrays",
    "sharp+depth": "20 Sharps and a depth camera",
    "vl53l5cx+depth": "20 arrays and the camera",
}


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


def images() -> str:
    """The default controller by what it sees, on the same encounters."""
    rows = []
    for sensor, found in measured("judged-images").items():
        touched = share(found["contacts"] / found["trials"], *found["intervals"]["contacts"])
        counts = [str(found[key]) for key in ("unseen", "moving", "towards", "over_limit", "furniture", "self")]
        rows.append(
            (
                SEES[sensor],
                f"{found['contacts']} of {found['trials']}: {touched}",
                *counts,
                f"{1e3 * found['distance_median']:.0f} mm",
                f"{found['lost_time_mean']:.2f} s",
            )
        )
    heads = ("sees by", "touched (95 %)", "unseen", "moving", "towards", "over limit", "furniture", "self")
    return lines((*heads, "distance, median", "time lost"), rows)


STANDING = ("contacts", "moving", "towards", "over_limit")


def standing() -> str:
    """The default controller beside the one whose links go on where they cannot get away."""
    return _beside("judged-standing", "unheld")


def friction() -> str:
    """The default controller beside the one whose evasion has no friction."""
    return _beside("judged-friction", "creeping")


def _beside(file: str, other: str) -> str:
    """The default controller beside another one that met the same people, a sensor after the other."""
    rows = []
    for sensor, found in measured(file).items():
        less = {row["measure"]: row for row in found["comparisons"]}
        for name in (other, "default"):
            run = found["controllers"][name]
            shares = [
                f"{run[key]} of {run['trials']:,}: {share(run[key] / run['trials'], *run['intervals'][key])}"
                for key in STANDING
            ]
            rows.append((SEES[sensor], f"`{name}`", *shares, f"{run['lost_time_mean']:.2f} s"))
        more = [
            f"{0.0 - less[key]['difference']:+.1%} (p = {less[key]['p']:.2g})".replace("%", " %") for key in STANDING
        ]
        rows.append((SEES[sensor], "the difference", *more, f"{-less['lost_time_mean']['difference']:+.2f} s"))
    return lines(("sees by", "", "touched (95 %)", "the robot moving", "towards", "over limit", "time lost"), rows)


TABLES = {
    "standing": standing,
    "friction": friction,
    "images": images,
    "place-arrays": place_arrays,
    "camera-calibration": camera_calibration,
}
