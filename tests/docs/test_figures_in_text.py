"""Numbers in sentences of the pages are those that docs/data_commands.py has measured; tables are filled from them."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.append(str(DOCS))

from data_commands import COMMANDS, DROPPED, rounded  # noqa: E402


def measured(name: str) -> Any:
    """What docs/data/NAME.json says."""
    return json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8"))


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
    assert len(runs) == 12
    nearest = {f"{1e3 * run['distance']:.0f}" for run in runs if run["speed"] == 2.0}
    assert len(nearest) == 1, "at 2.0 m/s the walker is nearest to the base plate in each experiment"
    return [f"The {nearest.pop()} mm at 2.0 m/s", "All twelve runs"]


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


def arrays(spots: dict[str, Any]) -> list[str]:
    found = measured("place-arrays")
    assert found["wanted"] == "nearest"

    def first(objective: str, what: str, at_least: float) -> int:
        """The fewest whose share on the independent pairs is that large, and stays so."""
        values = found["curves"][objective][what][1]
        return 1 + max(k for k, value in enumerate(values) if value < at_least)

    waist = sum(name.startswith("waist") for name in found["placements"]["nearest"]["spots"])
    return [
        f"To detect 95 % takes {first('detection', 'probability', 0.95)} arrays, "
        f"99 % takes {first('detection', 'probability', 0.99)}",
        f"(5 detect {100 * found['curves']['detection']['probability'][1][5]:.1f} %)",
        f"20 Sharps see that part of {100 * spots['nearest']:.0f} % of the people",
        f"To see the nearest part of 95 % takes {first('nearest', 'nearest', 0.95)} arrays, "
        f"of 99 % takes {first('nearest', 'nearest', 0.99)}",
        f"are on the waist ({waist})",
    ]


def pick() -> list[str]:
    found = measured("pick")
    runs, alone = found["runs"], found["without_people"]
    return [
        f"A cycle takes {alone['duration'] / len(alone['cycle_times']):.1f} s without people",
        f"seeds 0 to {len(runs) - 1}",
        f"nothing but the tool's tip came nearer than {1e3 * min(run['clearance'] for run in runs):.0f} mm",
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
    found = measured("ticks")
    runs = {row["runs"] for name, row in found["results"].items() if "batch" not in name}
    assert runs == {20000}
    return [f"({found['machine']['processor']}, a virtual machine with two cores"]


def faq() -> list[str]:
    tick = 1e6 * measured("ticks")["results"]["whole tick, 20 distances"]["median"]
    return [f"About {10 * round(tick / 10)} µs a tick"]


def batch() -> list[str]:
    alone = measured("ticks")["results"]["a robot of a batch of 1000, nobody in sight, one core"]
    return [f"on one core, takes {1e6 * alone['median']:.1f} µs with nobody in sight"]


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


PAGES: dict[str, Callable[[], list[str]]] = {
    "explanation/demo-path.md": path,
    "how-to/stories.md": fast_person,
    "explanation/compare.md": compare,
    "how-to/placement.md": place,
    "explanation/demo-pick-and-place.md": pick,
    "explanation/hierarchical-qp.md": hqp,
    "explanation/one-tick.md": bench,
    "how-to/faq.md": faq,
    "how-to/batch.md": batch,
    "how-to/stream.md": stream,
}


@pytest.mark.parametrize("page", PAGES)
def test_sentences_say_what_was_measured(page: str) -> None:
    text = " ".join((DOCS / page).read_text(encoding="utf-8").replace("**", "").split())
    assert [sentence for sentence in PAGES[page]() if sentence not in text] == []


def test_every_command_has_its_file() -> None:
    there = {file.stem for file in (DOCS / "data").glob("*.json")}
    assert set(COMMANDS) <= there
    assert set(DROPPED) <= set(COMMANDS)


def test_rounding_keeps_what_pages_show() -> None:
    assert rounded({"a": [1.23456789, 7, None], "b": 1e-17}) == {"a": [1.23457, 7, None], "b": 1e-17}
