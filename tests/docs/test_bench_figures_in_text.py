"""Numbers in sentences are those that docs/data_commands.py has measured: laws, solvers, time, the wire."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qpsafe

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs"))

from data_commands import COMMANDS, DROPPED
from noted import DATA, measured, rounded, unsaid


def separation() -> list[str]:
    without, rows = (measured("separation")[key] / 1e3 for key in ("without", "with"))
    return [f"took {rows:.2f} ms instead of {without:.2f} (medians"]


def clearance() -> list[str]:
    runs = measured("clearance")["runs"]
    bound = [run for run in runs if run["bound"]]
    *others, worst = sorted((1e3 * run["smallest"] for run in bound), reverse=True)
    return [
        f"In {len(runs)} runs with goals",
        f"rows bound in {len(bound)}: {len(others)} of these kept {min(others):.1f} mm of the 4 mm",
        f"in one the elbow went {-worst:.1f} mm into a box",
        f"with it all {len(bound)} kept {1e3 * min(run['with_gate'] for run in bound):.1f} mm",
    ]


def laws() -> list[str]:
    first = measured("projection")["irb140"]["weighted"]
    robot = qpsafe.load_robot("irb140")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    hand = here.pose[:3, 3] + [0.45, 0.0, 0.0]  # of the page's snippet
    strict, weighted = (
        np.linalg.norm(
            qpsafe.SafetyController(robot, tasks, law=law).step(robot.home, np.zeros(6), points=[hand]).reference.qd
        )
        for law in (qpsafe.HierarchicalLaw(), qpsafe.WeightedLaw())
    )
    return [
        f"residual had a median of {first['median']:.0e} and at worst {first['worst']:.2f}".replace("e-0", "e-"),
        f"this law evades at {100 * weighted / strict:.0f} % of the speed of the others",
    ]


def limits() -> list[str]:
    found, back = measured("limits"), measured("plugins")["outside"]["0.05"]
    assert back["mink_raises"]
    return [
        f"it ends {1e3 * found['beyond']:.1f} mrad beyond; or it has to brake with up to {found['deceleration']:.2f} a",
        f"inside after {back['inside_after']:.2f} s with at most {back['speed']:.3f} rad/s "
        f"and {back['acceleration']:.1f} rad/s²",
    ]


def sensing() -> list[str]:
    still = measured("walkers")["still"]
    spots = 1e6 * measured("ticks")["results"]["sensing, 20 spots, all filters"]["median"]
    return [
        f"20 spots take about {spots:.0f} µs",
        f"are {still['0.50']:.2f} m/s at most at 0.5 m and {still['0.78']:.2f} m/s at most near the end",
        f"in high danger {measured('sensing')['earlier']:.2f} s earlier",
    ]


def gate() -> list[str]:
    nobody, somebody = (measured("gate")[key] for key in ("nobody near", "a person in reach"))
    added = [case["gate"] - case["neither"] for case in (nobody, somebody)]
    return [
        f"A tick of {nobody['neither']:.0f} µs with nobody near takes {added[0]:.1f} µs longer with the gate",
        f"one of {somebody['neither']:.0f} µs with a person in reach {added[1]:.1f} µs",
    ]


def compare() -> list[str]:
    loop = measured("compare")["closed_loop"]
    different, ticks = loop["different"], loop["ticks"]
    assert loop["explained"] == different
    assert abs(loop["largest_step"] - 1.0) < 1e-9
    return [
        f"{different:,} of {ticks:,} ticks ({100 * different / ticks:.0f} %) differ",
        f"the median of these by {loop['median']:.3f} rad/s, the worst by {loop['worst']:.2f} rad/s",
        f"In all {different:,} a limit binds",
        f"by up to {loop['largest_step_source']:.1f} times what",
    ]


def place() -> list[str]:
    free, share, caps = measured("place"), measured("place-share"), measured("place-caps")
    detect = free["curves"]["detection"]["probability"]
    fewest = share["placements"]["probability"]
    assert fewest["gap"] == 0.0
    fair = fewest["independent_sample"]

    def first(curve: str, sample: int, at_least: float) -> int:
        values = free["curves"][curve]["probability"][sample]
        return next(k for k, value in enumerate(values) if value >= at_least)

    costs = free["curves"]["cost"]["cost"][1]
    assert 0.025 < 1.0 - costs[254] / costs[1] < 0.035
    waist = sum(name.startswith("waist") for name in free["placements"]["detection"]["spots"])
    inside = caps["placements"]["detection"]["independent_sample"]
    per_pair = free["rays"][0]["detections_per_pair"]
    return [
        f"{1e3 * free['spacing']:.1f} mm for {free['nodes']} nodes",
        f"wire reaches ({free['radius']:.2f} m)",
        f"21 bytes a detection ({per_pair:.0f} a pair here)",
        f"That makes {300_000 * (21 * per_pair + 16) / 1e6:.0f} MB for each sample",
        f"89 % needs {len(fewest['spots'])} spots by (13)",
        f"greedy takes {first('detection', 0, 0.89)}.",
        f"these {len(fewest['spots'])} detect {100 * fair['probability']:.1f} % "
        f"({100 * fair['low']:.1f} to {100 * fair['high']:.1f})",
        f"greedy's order reaches 89 % with {first('detection', 1, 0.89)}.",
        f"{100 * detect[1][20]:.0f} % with 20 spots, {100 * detect[1][40]:.0f} % with 40, "
        f"{100 * detect[1][60]:.0f} % with 60, {100 * detect[1][254]:.1f} % with all 254",
        f"{first('cost', 1, 0.89)} spots for 89 %",
        "falls by 3 % only",
        f"puts {waist} of them on the waist",
        f"they detect {100 * inside['probability']:.1f} % ({100 * inside['low']:.1f} to {100 * inside['high']:.1f})",
        *arrays(inside),
    ]


def seen_by_arrays_of(robot: str) -> tuple[str, ...]:
    """Whom they detect and of whom they see the nearest part, as the head of the robot's file says [%]."""
    file = qpsafe.load_robot(robot).folder / "spots-vl53l5cx.toml"
    told = re.search(r"They detect (\S+) % .* and of (\S+) % \(", file.read_text(encoding="utf-8").replace("\n# ", " "))
    assert told is not None
    return told.groups()


def images() -> list[str]:
    found = measured("ticks")["results"]
    spots, arrays, dense = (
        1e6 * found[name]["median"]
        for name in (
            "whole tick, 20 distances",
            "whole tick, 20 arrays of 64 zones at 15 Hz",
            "one depth image, 640 x 480, reduced",
        )
    )
    return [
        f"a tick takes {arrays:.0f} µs instead of {spots:.0f} with 20 spots",
        f"A depth image of 640 x 480 takes {1e-3 * dense:.1f} ms",
    ]


def arrays(spots: dict[str, Any]) -> list[str]:
    found = measured("place-arrays")
    assert found["wanted"] == "nearest"

    def first(objective: str, what: str, at_least: float) -> int:
        """The fewest whose share on the independent pairs is that large, and stays so."""
        values = found["curves"][objective][what][1]
        return 1 + max(k for k, value in enumerate(values) if value < at_least)

    met = measured("place-encounters")
    near = {name: [f"{100 * share:.0f}" for share in met[name]["all"]] for name in ("spots", "vl53l5cx")}
    hand = {name: f"{100 * met[name]['hand'][1]:.0f}" for name in near}
    assert met["within"] == [0.1, 0.3]
    one, two = (seen_by_arrays_of(name) for name in ("iiwa14", "irb14000"))
    waist = sum(name.startswith("waist") for name in found["placements"]["nearest"]["spots"])
    return [
        f"To detect 95 % takes {first('detection', 'probability', 0.95)} arrays, "
        f"99 % takes {first('detection', 'probability', 0.99)}",
        f"(5 detect {100 * found['curves']['detection']['probability'][1][5]:.1f} %)",
        f"20 Sharps see that part of {100 * spots['nearest']:.0f} % of the people",
        f"To see the nearest part of 95 % takes {first('nearest', 'nearest', 0.95)} arrays, "
        f"of 99 % takes {first('nearest', 'nearest', 0.99)}",
        f"are on the waist ({waist})",
        f"20 arrays detect {one[0]} % around the iiwa 14 and see the nearest part of {one[1]} %; "
        f"{two[0]} % and {two[1]} % on the two arms of the IRB 14000",
        f"In {met['trials']} encounters",
        f"at {met['instants']} instants with somebody nearer than 0.5 m",
        f"by the 20 Sharps in {near['spots'][1]} %, by the 20 arrays in {near['vl53l5cx'][1]} %; "
        f"within 0.1 m in {near['spots'][0]} and {near['vl53l5cx'][0]} %",
        f"In {met['hands']} of them that part was a hand: {hand['spots']} and {hand['vl53l5cx']} % within 0.3 m",
    ]


def hqp() -> list[str]:
    sample, bench = measured("hqp-intervals"), measured("hqp-solvers")
    count, seed, verdicts = sample["problems"], sample["seed"], sample["verdicts"]["own"]
    assert verdicts == {"right": count}
    machine = bench["machine"]
    return [
        f"hqp_intervals.py --count {count} --seed {seed}`",
        f"All {count:,} are right",
        f"The default sample, {bench['problems']} problems, {bench['well_conditioned']} of them well-conditioned",
        f"drifting sequence of {bench['ticks']} ticks",
        f"({machine['processor']}, a virtual machine",
        f"Python {machine['python']}, numpy {machine['numpy']}, numba {machine['numba']}, daqp {machine['daqp']}",
    ]


def bench() -> list[str]:
    found, phases = measured("ticks"), measured("controller")["phases"]
    assert [change["phase"] for change in phases] == [*["suspended", "recovering"] * 3, "following"]  # twice more
    first, later = measured("compilation")["results"].values()
    begins, returns, again, goes_on = (phases[k]["time"] for k in (0, 1, -2, -1))
    runs = {row["runs"] for name, row in found["results"].items() if "batch" not in name}
    assert runs == {20000}
    return [
        f"({found['machine']['processor']}, a virtual machine with two cores",
        f"{len(first['kernels'])} kernels took {first['processor']:.0f} s of processor time on this machine, "
        f"imports included, and {later['processor']:.1f} s from the cache",
        f"From {begins:.1f} s on the path is suspended",
        f"At {returns:.1f} s danger has been small",
        f"comes back from {again:.1f} s on and goes on at {goes_on:.1f} s",
    ]


def faq() -> list[str]:
    tick = 1e6 * measured("ticks")["results"]["whole tick, 20 distances"]["median"]
    return [f"About {10 * round(tick / 10)} µs a tick"]


def batch() -> list[str]:
    of = {name.partition("1000, ")[2]: 1e6 * row["median"] for name, row in measured("ticks")["results"].items()}
    return [
        f"on one core, takes {of['nobody in sight, one core']:.1f} µs with nobody in sight",
        f"it takes {of['one core']:.0f} µs on one core and {of['two cores']:.0f} µs on two",
    ]


def stream() -> list[str]:
    wire, runs = measured("wire"), measured("stream")["results"]
    exact, late, faults = wire["lock_step"], wire["one_process_late"], measured("irc5-faults")
    cases = faults["cases"]
    assert faults["good"]
    assert exact["largest"] == 0.0
    assert all(run["real_time"] and run["duration"] == 60.0 for run in runs)
    assert max(case["change"] for case in cases) == 1.0
    assert max(case["seed"] for case in cases) == 0.0
    return [
        f"{exact['duration']:.0f} s of the first experiment, {exact['answers']:,} answers, "
        f"joints that move by {exact['moved']:.2f} rad",
        f"at most {late['largest']:.3f} rad, {late['rms']:.4f} rad rms",
        f"{len(cases)} faults at {cases[0]['moments']} moments each: all kept",
        f"largest reference step {max(case['step'] for case in cases):.2f} of what",
        "began " + " and ".join(str(run["robot"]["late"]) for run in runs) + " of its cycles",
    ]


def gym() -> list[str]:
    found = measured("gym")
    assert found["async"] < found["sync"]
    return [f"One environment makes {100 * round(found['alone'] / 100):,} steps in a second"]


def plugin_ticks() -> list[str]:
    six, fourteen = ([kind["median"] for kind in robot.values()] for robot in measured("plugin-ticks").values())
    return [
        f"mink alone {six[0]:.0f} µs on the IRB 140, with `EvasiveTask` and `JointLimit` {six[1]:.0f} µs, "
        f"with `DangerLimit` too {six[2]:.0f} µs",
        "on the 14 joints of the IRB 14000 {:.0f}, {:.0f} and {:.0f} µs".format(*fourteen),
    ]


PAGES: dict[str, Callable[[], list[str]]] = {
    "reference/range-images.md": images,
    "explanation/clearance.md": clearance,
    "explanation/compare.md": compare,
    "explanation/hierarchical-qp.md": hqp,
    "explanation/laws.md": laws,
    "explanation/limits.md": limits,
    "explanation/one-tick.md": bench,
    "explanation/separation.md": separation,
    "explanation/verified-motion.md": gate,
    "how-to/batch.md": batch,
    "how-to/faq.md": faq,
    "how-to/gym.md": gym,
    "how-to/placement.md": place,
    "how-to/plugins.md": plugin_ticks,
    "how-to/stream.md": stream,
    "reference/sensing.md": sensing,
}


@pytest.mark.parametrize("page", PAGES)
def test_sentences_say_what_was_measured(page: str) -> None:
    assert unsaid(page, PAGES[page]()) == []


def test_every_command_has_its_file() -> None:
    there = {file.stem for file in DATA.glob("*.json")}
    assert set(COMMANDS) <= there
    assert set(DROPPED) <= set(COMMANDS)


def test_rounding_keeps_what_pages_show() -> None:
    assert rounded({"a": [1.23456789, 7, None], "b": 1e-17}) == {"a": [1.23457, 7, None], "b": 1e-17}
