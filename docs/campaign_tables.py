"""Fill tables of measured figures in README.md and docs from docs/data/*.json: python docs/campaign_tables.py."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from qpsafe.sim.campaign.report.markdown import filled

DOCS = Path(__file__).resolve().parent
sys.path.append(str(DOCS))

import bench_tables  # noqa: E402
import demo_tables  # noqa: E402
import ranging_tables  # noqa: E402
from noted import measured  # noqa: E402

#: Pages with tables, and the campaign each is filled from.
PAGES = {
    page: "verified" if page.stem == "verified-motion" else "campaign"
    for page in sorted((DOCS.parent / "README.md", *DOCS.rglob("*.md")))
    if ": end -->" in page.read_text(encoding="utf-8")
}


def worst() -> str:
    """What the searches for the worst have found, a line a controller."""
    head = "| controller | trials | near, searched | near, random | worst harm, searched | worst harm, random | new |"
    rows = [head, "| --- | --- | --- | --- | --- | --- | --- |"]
    for name, found in measured("worst").items():
        rows.append(
            f"| `{name}` | 2 x {found['budget']} | {found['searched']} | {found['random']} | {found['worst']:.2f} "
            f"| {found['worst_random']:.2f} | {found['new']} |"
        )
    return "\n".join(rows)


def engine() -> str:
    """How near the engine is to MuJoCo, and how fast, in a table."""
    near, fast = measured("engine"), measured("speed")
    rows = [
        ("encounters, ticks compared", f"{near['trials']}, {near['compared']:,}"),
        ("readings that both have", f"{near['hits']:,}"),
        ("readings that one has only (grazes)", str(near["grazes"])),
        ("largest difference of readings [m]", f"{near['readings']:.1e}"),
        ("of joint references [rad]", f"{near['references']:.1e}"),
        ("of true distances [m]", f"{near['distances']:.1e}"),
        ("engine, simulated seconds a second of one core", f"{fast['engine']:.0f}"),
        ("the same with planning what people do", f"{fast['planned']:.0f}"),
        ("MuJoCo's rays, distances and dynamics in a loop", f"{fast['mujoco']:.1f}"),
        ("two processes over one", f"{fast['two_workers']:.2f}"),
    ]
    return "\n".join(["| what | measured |", "| --- | --- |", *(f"| {what} | {value} |" for what, value in rows)])


def peers() -> str:
    """What becomes of the same troubles in other libraries and here, a line a trouble."""
    found = measured("peers")
    names = ("mink", "pink", "pink, `AccelerationLimit`", "placo", "qpsafe")

    def told(trouble: str, run: dict[str, Any]) -> str:
        if "raises" in run:
            return f"raises `{run['raises']}`"
        if "sends" in run:
            return f"sends {run['sends']}"
        hard = (
            f"{run['acceleration']:.0f} times the acceleration limit"
            if run["acceleration"] > 1.01
            else "within all limits"
        )
        if trouble == "outside":
            return f"comes back at up to {run['fastest']:.1f} rad/s, {hard}"
        if trouble == "jump":
            return hard
        if trouble == "beyond":
            turns = f", {run['reversals']} reversals" if run["reversals"] else ""
            return f"still {run['last']:.1f} rad/s{turns}" if run["last"] else "at rest"
        return "stays at rest" if run["fastest"] == 0.0 else f"brakes, {hard}"

    heads = {
        "outside": "joint 2 starts 20 mrad beyond its limit",
        "jump": "the target jumps by 0.15 m",
        "beyond": "the target is 1 m away, beyond reach: the last of 12 s",
        "unreadable": "one measurement is NaN",
    }
    titles = [f"{name} {found[name]['version']}" for name in names]
    rows = [f"| trouble | {' | '.join(titles)} |", "|" + " --- |" * (1 + len(names))]
    for trouble, head in heads.items():
        rows.append(f"| {head} | {' | '.join(told(trouble, found[name][trouble]) for name in names)} |")
    speeds = (f"{speed:.1f} rad/s with {damping}" for damping, speed in found["mink"]["damped"].items())
    rows += [
        "",
        f"With Levenberg-Marquardt damping (`lm_damping`) mink ends the third line at {' and at '.join(speeds)}.",
    ]
    return "\n".join(rows)


def approaches() -> list[tuple[dict[str, Any], dict[str, Any], dict[str, Any]]]:
    """Of each approach of the first experiment: its distances, its medium danger before high, its high danger."""
    found = measured("fixed")
    regimes = found["regimes"]
    told = []
    for approach in found["approaches"]:
        within = [regime for regime in regimes if approach["start"] <= regime["entered"] <= approach["end"]]
        medium, high = (next(regime for regime in within if regime["regime"] == name) for name in ("medium", "high"))
        told.append((approach, medium, high))
    return told


def distances() -> list[str]:
    """What is gained on the board in the first experiment, two rows."""
    rows = {"smallest distance to the board, with the controller": "with_controller"}
    rows["the same if the robot keeps its pose"] = "without_controller"
    return [f"| {row} | {' | '.join(f'{own[key]:.3f} m' for own, *_ in approaches())} |" for row, key in rows.items()]


def fixed() -> str:
    """The first experiment, a column an approach."""
    found = approaches()
    kept = [check["kept"] for check in measured("fixed")["checks"] if check["name"].startswith("order of Table I")]
    rows = {
        "low, medium, high and back, one at a time": ["yes" if good else "no" for good in kept],
        "largest CDF_n (held points included, see below)": [f"{high['cdf_n']:.1f}" for *_, high in found],
        "largest position error in medium, before high (< 2 mm)": [
            f"{1e3 * medium['position_error']:.3f} mm" for _, medium, _ in found
        ],
        "largest orientation error in it (> 0.05 rad: it is released)": [
            f"{medium['orientation_error']:.3f} rad" for _, medium, _ in found
        ],
    }
    head = ["| promise | front | left | right |", "| --- | --- | --- | --- |"]
    return "\n".join([*head, *(f"| {row} | {' | '.join(cells)} |" for row, cells in rows.items()), *distances()])


def gained() -> str:
    """The same for the page about placement: whether it is seen, and what is gained."""
    released = " | ".join(f"{medium['orientation_error']:.3f} rad" for _, medium, _ in approaches())
    head = ["| | front | left | right |", "| --- | --- | --- | --- |"]
    return "\n".join([*head, f"| orientation released in medium danger (> 0.05 rad) | {released} |", *distances()])


def judged() -> str:
    """The default controller on encounters that nothing was chosen by, a line a sensor; and beside the plain stop."""
    defaults = {name: measured(f"judged-{name}")["controllers"]["default"] for name in ("ideal", "sharp")}
    found = {f"default, {name}, {own['trials']:,} encounters": own for name, own in defaults.items()}
    alone = {"controllers": found, "references": []}
    tables = []
    for measures, summary in (
        ("contacts, moving, towards, over_limit, unseen, furniture, self", alone),
        ("distance_median, energy_mean, lost_time_mean, suspensions_mean, reversals_mean", alone),
        (
            "less stop: contacts, moving, towards, over_limit, harm_mean, energy_mean, lost_time_mean",
            measured("judged-stop"),
        ),
    ):
        lines = filled(f"<!-- campaign: {measures} -->\n<!-- campaign: end -->", summary).splitlines()
        tables.append("\n".join(lines[2:-2]))
    paired = measured("judged-stop")["trials"]["finished"]
    which = f"ideal sensors, in the first {paired:,} of these, trial by trial:"
    tables.insert(2, f"The difference to `stop`, {which}")
    return "\n\n".join(tables)


def brisk() -> str:
    """The setting between the stop and the default, beside both, on the same encounters."""
    marks = "<!-- campaign: contacts, moving, towards, over_limit, harm_mean, energy_mean, lost_time_mean -->"
    lines = filled(f"{marks}\n<!-- campaign: end -->", measured("judged-stop")).splitlines()
    return "\n".join(lines[2:-2])


def tuned() -> str:
    """What came of each run of `qpsafe tune`, judged on encounters that nothing was tuned on."""
    heads = ("robot", "search", "tried, all encounters", "processor time [s]", "judged on", "harm", "work lost [s]")
    rows = [f"| {' | '.join((*heads, 'contacts', 'furniture, self'))} |", "|" + " --- |" * 9]
    for run in measured("tune")["runs"] + measured("tune-foreign")["runs"]:
        judged, search = run["judgement"], run["search"]
        name, tried = f"`{run['robot']}`", f"{run['tried']}, {run['whole']} | {search['processor_s']:.0f}"
        if judged is None:
            rows.append(f"| {name} | {search['seed']} | {tried} | - | {run['sentence']} | | | |")
            continue
        harm, lost = judged["means"]["harm"], judged["means"]["lost"]
        touched, *others = (judged["shares"][key] for key in ("contacts", "furniture", "self"))
        cells = [
            f"{harm['present']:.4f} to {harm['tuned']:.4f}, p = {harm['p']:.2g}",
            f"{lost['present']:.2f} to {lost['tuned']:.2f}, p = {lost['p']:.2g}",
            f"{touched['present']} to {touched['tuned']}, p = {touched['p']:.2g}",
            ", ".join(f"{other['present']} to {other['tuned']}" for other in others),
        ]
        rows.append(f"| {name} | {search['seed']} | {tried} | {judged['encounters']:,} | {' | '.join(cells)} |")
    return "\n".join(rows)


def tuned_values() -> str:
    """Present and chosen values of the first run."""
    run = measured("tune")["runs"][0]
    rows = ["| parameter | present | chosen |", "| --- | --- | --- |"]
    for table, keys in run["present"]["values"].items():
        for key, value in keys.items():
            both = (value, run["chosen"]["values"][table][key])
            cells = (", ".join(f"{x:.3g}" for x in (one if isinstance(one, list) else [one])) for one in both)
            rows.append(f"| `[{table}] {key}` | {' | '.join(cells)} |")
    return "\n".join(rows)


def floor() -> str:
    """What is left where everybody is seen: shares of encounters, then the contacts by the part that is touched."""
    found = measured("perfect-sight")
    shares = (
        ("without control, touched", "without"), ("the default controller, touched", "contacts"),
        ("touched while it moves", "moving"), ("while it moves towards the person", "towards"),
        ("touched, and no motion without contact was found", "left"),
    )  # fmt: skip
    rows = [
        f"| of {found['encounters']} encounters, everybody seen | trials | % (limits at 95 %) |",
        "| --- | --- | --- |",
    ]
    for words, key in shares:
        one = found[key]
        rows.append(f"| {words} | {one['hits']} | {100 * one['value']:.1f} ({_limits(one)}) |")
    heads = ("touched part of the robot", "contacts", "at rest", "a motion without was found", "surely none")
    rows += ["", f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)]
    rows += [f"| `{name}` | {' | '.join(str(n) for n in part.values())} |" for name, part in found["parts"].items()]
    return "\n".join(rows)


def _limits(share: dict[str, Any]) -> str:
    return f"{100 * share['low']:.1f} to {100 * share['high']:.1f}"


TABLES = {
    "floor": floor,
    "judged": judged,
    "brisk": brisk,
    "tuned": tuned,
    "tuned-values": tuned_values,
    "worst": worst,
    "engine": engine,
    "peers": peers,
    "fixed": fixed,
    "gained": gained,
    **demo_tables.TABLES,
    **bench_tables.TABLES,
    **ranging_tables.TABLES,
}


def made(text: str, campaign: str = "campaign") -> str:
    """A page with all its tables made anew.

    Args:
        text: Of the page.
        campaign: Name of the file in docs/data.
    """
    text = filled(text, measured(campaign))
    for mark, table in TABLES.items():
        pattern = re.compile(rf"<!-- {mark} -->\n.*?<!-- {mark}: end -->", re.DOTALL)
        text = pattern.sub(lambda _, m=mark, t=table: f"<!-- {m} -->\n\n{t()}\n\n<!-- {m}: end -->", text)
    return text


if __name__ == "__main__":
    for page, campaign in PAGES.items():
        page.write_text(made(page.read_text(encoding="utf-8"), campaign), encoding="utf-8")
