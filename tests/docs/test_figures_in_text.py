"""Numbers in sentences are those that docs/data_commands.py and the figures' scripts have measured: experiments."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs"))

from noted import measured, unsaid


def fixed() -> list[str]:
    run, others = measured("fixed"), {law: measured(f"fixed-{law}") for law in ("paper", "weighted", "nullspace")}
    said = {check["name"]: check["measured"] for check in run["checks"]}
    assert said["position error before anything is detected"] == "0 mm"
    assert said["orientation error before anything is detected"] == "0 rad"
    assert others["paper"]["kept"]
    assert others["nullspace"]["kept"]
    missed = [check for check in others["weighted"]["checks"] if not check["kept"]]
    assert all(check["name"].startswith("orientation error in medium") for check in missed)
    errors = [float(check["measured"].split()[0]) for check in missed]
    assert len(errors) == 3
    late, turned = (said[f"{what} error 10 s after the last withdrawal"] for what in ("position", "orientation"))
    position, orientation = run["tracking"]
    return [
        f"after the last withdrawal they are {late} and {turned}",
        f"differ by at most {1e3 * position:.2f} mm and {orientation:.4f} rad",
        f"the former with {others['nullspace']['unusual'][0]} ticks clipped",
        f"in medium danger is {max(errors):.3f} rad at most",
    ]


def path() -> list[str]:
    laws = measured("path")["laws"]
    strict, free, paper = laws["strict"], laws["strict, no recovery"], laws["paper"]
    assert strict["smooth_acceleration"] < strict["return_acceleration"] == 0.5
    return [
        f"with that projection {paper['line_orientation']:.3f} rad remain",
        f"{free['return_speed'] / strict['return_speed']:.1f} times lower than without, accelerations half",
        f"it is {strict['smooth_acceleration']:.2f} of the limit",
        f"it gets {paper['travelled']:.1f} s along the path instead of {strict['travelled']:.1f}",
        f"suspended {strict['suspensions']} times in two approaches",
    ]


def fast_person() -> list[str]:
    runs = measured("fast-person")
    assert len(runs) == 15
    sharp = measured("fast-person-sharp")
    moving, late = (min(run["moving_links"] for run in some if run["speed"] <= 2.0) for some in (runs, sharp))
    (touched,) = (run for run in sharp if run["contact"] is not None)
    assert touched["speed"] == 2.5
    assert touched["towards_speed"] < 0.0
    between = measured("fast-person-between")
    speeds, hit = [run["speed"] for run in between], sum(run["contact"] is not None for run in between)
    least, next_one = sorted(run["moving_links"] for run in between)[:2]
    assert next_one > 10.0 * max(least, 0.0)  # at one
    nearest = {f"{1e3 * run['distance']:.0f}" for run in runs if run["speed"] == 2.0}
    assert len(nearest) == 1, "at 2.0 m/s the walker is nearest to the base plate in each experiment"
    return [
        f"The {nearest.pop()} mm at 2.0 m/s",
        f"links that move stay {1e3 * moving:.0f} mm away",
        f"links that move stay {1e3 * late:.0f} mm away",
        f"while it goes away at {-touched['towards_speed']:.2f} m/s",
        "All fifteen runs",
        f"of {len(speeds)} speeds between these, {min(speeds):.2f} to {max(speeds):.2f} m/s, the robot",
        f"touched at {hit or 'none'}, and comes within {1e3 * least:.0f} mm at one (`python docs/data_commands.py "
        "fast-person-between`)",
    ]


def pick() -> list[str]:
    found = measured("pick")
    runs, alone = found["runs"], found["without_people"]
    program = PickPlaceExperiment(qpsafe.load_robot("irb140")).reference.duration
    return [
        f"cost about {found['cost_per_cycle']['median']:.0f} s more in each",
        f"a cycle takes {(alone['duration'] - program) / len(alone['cycle_times']):.1f} s longer than its program",
        f"A cycle takes {alone['duration'] / len(alone['cycle_times']):.1f} s without people",
        f"seeds 0 to {len(runs) - 1}",
        f"nothing but the tool's tip came nearer than {1e3 * min(run['clearance'] for run in runs):.0f} mm",
    ]


def robots() -> list[str]:
    assert {row["robot"] for row in measured("robots")} == set(qpsafe.bundled_robots())
    returned = max((row["returned"] for row in measured("robots")), key=lambda text: float(text.split()[0]))
    robot = qpsafe.load_robot("irb140")
    wire, tip, field = robot.wire(robot.home, np.zeros(6)), robot.pose("tcp", robot.home)[:3, 3], qpsafe.DangerField()
    near, far = (field.value(tip[None] + [[ahead, 0.0, 0.0]], wire)[0] for ahead in (0.34, 0.54))
    wire.ends[-1] = robot.pose("flange", robot.home)[:3, 3]
    bare, bare_far = (field.value(tip[None] + [[ahead, 0.0, 0.0]], wire)[0] for ahead in (0.34, 0.54))
    iiwa = qpsafe.robot_activation(qpsafe.load_robot("iiwa14")).thresholds
    yumi = qpsafe.robot_activation(qpsafe.load_robot("irb14000"), 1, 1).thresholds
    return [
        f"every tool is back within {returned}",
        f"has a field of {near:.2f} at 0.34 m and {far:.2f} at 0.54 m",
        f"ending the wire at the flange gives {bare:.2f} and {bare_far:.2f}",
        f"| {iiwa[0].delta:.2f} | {iiwa[1].delta:.2f} |",
        f"| {yumi[0].delta:.2f} | {yumi[1].delta:.2f} |",
    ]


def barrier() -> list[str]:
    found = measured("barrier")
    passed = [found[cap]["danger_in_pause"] - float(cap) for cap in ("10.5", "9.5")]
    gained = [1e3 * (found[cap]["distance"] - found["none"]["distance"]) for cap in ("9.5", "10.5")]
    return [
        f"10.5 is passed by {passed[0]:.2f} and 9.5 by {passed[1]:.2f}",
        f"With 9.5 the robot keeps {gained[0]:.0f} mm more",
        f"reaches anyway and gains {gained[1]:.0f} mm",
    ]


def campaign() -> list[str]:
    found = measured("campaign")
    done, planned = (found["trials"][key] * len(found["controllers"]) for key in ("finished", "planned"))
    hours = found["engine"]["processes_s"] / 3600
    seen = measured("perfect-sight")
    low = sum(seen["parts"].get(part, {"contacts": 0})["contacts"] for part in ("joint_1", "joint_2", "base"))
    return [
        f"{seen['hands']} of the {seen['contacts']['hits']} touch with a hand, and {low} at the turntable",
        f"planned for {found['trials']['planned']:,} trials, {planned:,} runs",
        f"after {done:,} runs, which took {hours:.1f} hours of processor time",
    ]


def tune() -> list[str]:
    run = measured("tune")["runs"][0]
    (now, *others), means = run["finals"]["finalists"], run["judgement"]["means"]
    tried, number = {trial["number"]: trial for trial in run["trials"]}, run["chosen"]["number"]
    searched = {one["number"]: tried[one["number"]]["harm"] - tried[0]["harm"] for one in others}
    assert all(one["harm"] - now["harm"] > searched[one["number"]] for one in others)
    assert min([now, *others], key=lambda one: one["harm"]) is now
    (chosen,) = (one for one in others if one["number"] == number)
    assert not run["judgement"]["worth"]
    return [
        f"harm {chosen['harm'] - now['harm']:+.4f} and work lost {chosen['lost'] - now['lost']:+.2f} s there",
        f"{means['harm']['value']:+.4f} and {means['lost']['value']:+.2f} s in the judgement",
        f"seemed to cost {searched[number]:+.4f}",
        f"All {len(others)} finalists did more harm",
        *tune_others(),
        *tune_foreign(run["judgement"]),
    ]


def tune_others() -> list[str]:
    """Searches of other seeds and of other bundled robots; nothing of any surely does less harm."""
    first, *others = measured("tune")["runs"]
    better = [run for run in others if all(run["chosen"][key] < run["present"][key] for key in ("harm", "lost"))]
    trading = [run for run in others if run not in better]
    assert not any(run["judgement"]["means"]["harm"]["high"] < 0.0 for run in [first, *others])

    def cost(run: dict[str, Any]) -> str:
        harm, lost = (run["judgement"]["means"][key] for key in ("harm", "lost"))
        gained = f"for work lost {lost['value']:+.2f} s (p = {lost['p']:.2g})"
        return f"harm {harm['value']:+.4f} (p = {harm['p']:.2g}) {gained}"

    return [
        f"What {('none', 'one', 'two', 'three', 'four')[len(better)]} of them chose was better in both",
        *map(cost, better),
        *(f"search {run['search']['seed']} trades in its finals already, and costs {cost(run)}" for run in trading),
    ]


def tune_foreign(bundled: dict[str, Any]) -> list[str]:
    found = measured("tune-foreign")
    (run,), fixed = found["runs"], found["fixed"]
    judged = run["judgement"]
    assert run["sentence"].startswith("The present values were already as good")
    assert not judged["new_faults"]
    assert judged["shares"]["contacts"]["tuned"] <= judged["shares"]["contacts"]["present"]
    gains = {}
    for name, said in fixed.items():
        assert said["kept"]
        assert "distance to the board, approach at 3.5 s" in said["left_out"]
        ways = [1e3 * (one["with_controller"] - one["without_controller"]) for one in said["approaches"]]
        gains[name] = " and ".join(f"{way:.0f}" for way in ways)
    shares = [(one["shares"]["contacts"]["present"], one["encounters"]) for one in (judged, bundled)]
    (mine, of), (theirs, all_of) = shares
    assert mine / of < theirs / all_of
    return [
        f"touched in {mine} of {of} encounters, {100 * mine / of:.1f} %",
        f"what it shipped then in {theirs} of {all_of:,}, {100 * theirs / all_of:.1f} %",
        f"gain {gains['before']} mm before, {gains['after']} mm after",
    ]


def check() -> list[str]:
    found = measured("check")
    since = found["trouble"].split("not kept from ")[1].removesuffix(" on")
    return [f"nearer than 4 mm from {since} on, and {-1e3 * found['distance']:.0f} mm in it"]


def calibrate() -> list[str]:
    found = measured("sensing")
    return [
        f"{100 * found['within_1_cm']:.2f} % of the live, noisy samples",
        f"95 % within {100 * found['error_95']:.2f} cm",
    ]


def plugins() -> list[str]:
    alone, ours = measured("plugins")["swing"].values()
    return [
        f"passes within {1e3 * alone['distance']:.0f} mm of the hand, at a danger of {alone['danger']:.0f}",
        f"never comes nearer than {1e3 * ours['distance']:.0f} mm",
    ]


def redundancy() -> list[str]:
    swift, slow = measured("redundancy")["2"], measured("redundancy")["20"]
    return [
        f"({swift['danger']:.2f} at most,",
        f"swings out by {swift['gained']:.2f} m, to {swift['distance']:.2f} m from the person",
        f"by more than {1e3 * swift['position']:.3f} mm and {swift['orientation']:.1e} rad".replace("e-0", "e-"),
        f"moved its elbow by {1e3 * slow['gained']:.0f} mm",
    ]


def people() -> list[str]:
    found = measured("stumbles")
    return [
        f"{found['median']:.1f} m/s at the median of the peaks, {found['p95']:.1f} m/s at the 95th percentile "
        f"({found['stumbles']} stumbles, {found['fastest']:.1f} m/s the fastest)"
    ]


def recovery() -> list[str]:
    paper = measured("campaign")["controllers"]["paper"]
    return [f"the paper's law suspends {paper['suspensions_mean']:.1f} times an encounter"]


def any_robot() -> list[str]:
    found = measured("other-robots")
    kept = {name for name, run in found.items() if run["code"] == 0}
    assert kept == {"fixed ur5", "fixed panda", "fixed xarm7", "fixed kinova", "path xarm7", "pick ur5"}
    ways = {
        name: [1e3 * (one["with_controller"] - one["without_controller"]) for one in run["approaches"]]
        for name, run in found.items()
        if name.startswith("fixed")
    }
    gained = sorted(way for some in ways.values() for way in some)
    assert sum(way < 1.0 for way in ways["fixed ur5"]) == sum(way < 1.0 for way in gained) == 1
    (run,) = found["pick ur5"]["runs"]
    assert run["contacts"] == run["lost"] == 0
    assert run["taken"] == 1
    assert "some layout" in found["pick irb14000"]["refused"]
    (finger,) = re.findall(r"reaches (\S+ mm) beyond", found["pick panda"]["refused"])
    return [
        f"end an approach {gained[0]:.0f} to {gained[-1]:.0f} mm farther from the board",
        f"({run['delivered']} cycles, nearest {1e3 * run['nearest']:.0f} mm, no contact)",
        f"a finger reaches {finger} beyond its tool's frame",
    ]


PAGES: dict[str, Callable[[], list[str]]] = {
    "explanation/barrier.md": barrier,
    "explanation/campaign-people.md": people,
    "explanation/campaign.md": campaign,
    "how-to/tune.md": tune,
    "explanation/demo-fixed.md": fixed,
    "explanation/demo-path.md": path,
    "explanation/demo-pick-and-place.md": pick,
    "explanation/recovery.md": recovery,
    "explanation/redundancy.md": redundancy,
    "how-to/calibrate.md": calibrate,
    "how-to/check.md": check,
    "how-to/plugins.md": plugins,
    "how-to/stories.md": fast_person,
    "how-to/any-robot.md": any_robot,
    "reference/robots.md": robots,
}


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_sentences_say_what_was_measured(page: str) -> None:
    assert unsaid(page, PAGES[page]()) == []
