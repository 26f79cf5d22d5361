"""The report: one page with everything in it, for the screen, a phone and paper."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Any

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.figures import distance_figure, energy_figure, harm_figure, kinds_figure, svg
from qpsafe.sim.campaign.report.html import Html, element, joined, page, table
from qpsafe.sim.campaign.report.limits import limits_section
from qpsafe.sim.campaign.report.measures import FIGURES, MEASURES, SHARES, FigureMeasure, ShareMeasure, percent
from qpsafe.sim.campaign.runner import Results
from qpsafe.sim.campaign.trials.rows import COLUMNS, of_controller
from qpsafe.text.words import counted

LEVEL = 0.05


def report_page(results: Results, found: dict[str, Any]) -> str:
    """The page.

    Args:
        results: With the rows, for distributions.
        found: Their summary.
    """
    return page(f"Campaign: {counted(found['trials']['finished'], 'trial')}", *_sections(results, found))


def show_command(plan: Plan, trial: int, controller: str) -> str:
    """The command that plays a trial again.

    Args:
        plan: Of the campaign.
        trial: Its number.
        controller: Who is to be seen.
    """
    options = plan.options(("trials", "controllers"))
    return f"qpsafe campaign show {trial} --controller {shlex.quote(controller)} {options}".rstrip()


def _sections(results: Results, found: dict[str, Any]) -> Iterator[Html]:
    controllers = found["controllers"]
    rows = {name: of_controller(results.columns, name) for name in controllers}
    done, planned = found["trials"]["finished"], found["trials"]["planned"]
    yield element("h1", f"Campaign: {counted(len(controllers), 'controller')}, {counted(done, 'trial')}")
    rest = "" if done == planned else f" It is not finished: {done:,} of {planned:,} trials."
    yield element(
        "p",
        f"The same people, on the same seeds {found['seeds'][0]} to {found['seeds'][1]}, meet a robot under every "
        f"controller.{rest} Small print under a number: its limits at 95 %.",
        class_="soft",
    )
    yield _findings(found["findings"])
    yield element("h2", "Harm against cycle time")
    yield _figure(svg(harm_figure(controllers), "harm"), "Boxes: limits at 95 % in both directions. Best is down left.")
    yield element("h2", "Contacts and work")
    yield _measured(controllers, SHARES, "trials with")
    yield _measured(controllers, FIGURES, "mean or quantile")
    yield element("h2", "Kinds of contact")
    yield _figure(
        svg(kinds_figure(controllers), "kinds"), "What the robot's touching point did one tick before contact."
    )
    if "limits" in found:
        yield limits_section(found["limits"], {name: controllers[name]["contacts"] for name in found["limits"]})
    yield element("h2", "Distances and energies")
    yield _figure(svg(distance_figure(rows), "distance"), "All trials; up to the largest controller's 95 %.")
    yield _figure(svg(energy_figure(rows), "energy"), "All trials; those without contact count as 0.")
    yield element("h2", "Compared, trial by trial")
    for reference in found["references"]:
        yield _compared(found, reference)
    yield element("h2", "By motion")
    yield _motions(controllers)
    yield element("h2", "The worst trials")
    for name in controllers:
        yield _worst(results.plan, name, found["worst"][name])
    yield element("h2", "How it was counted")
    yield element("ul", *(element("li", text) for text in found["statistics"]["methods"]))
    yield element("p", _size(found["statistics"]))
    yield from _definitions()
    yield element("h2", "The plan")
    yield table(("key", "value"), [(key, _words(value)) for key, value in found["plan"].items()], range(2))
    yield table(("made with", "version"), list(found["versions"].items()), range(2))
    yield element("p", _times(found["engine"]), class_="soft", id="times")


def _findings(faults: list[str]) -> Html:
    if not faults:
        text = "No controller passed a joint limit, gave a bad command, or was worse for people than no control."
        return element("p", text, class_="fine")
    return element(
        "div", element("strong", "Faults"), element("ul", *(element("li", f) for f in faults)), class_="fault"
    )


def _figure(image: str, caption: str) -> Html:
    return element("figure", Html(image), element("figcaption", caption))


def _cell(value: str, below: str) -> Html:
    return joined((value, element("small", below)))


def _measured(controllers: dict[str, Any], measures: Sequence[ShareMeasure | FigureMeasure], first: str) -> Html:
    lines = [[name, *(_cell(*m.cells(found)) for m in measures)] for name, found in controllers.items()]
    return table([first, *(m.heading for m in measures)], lines)


def _compared(found: dict[str, Any], reference: str) -> Html:
    """Differences to a reference; bold where they are significant."""
    lines: dict[str, list[str]] = {}
    for item in (item for item in found["comparisons"] if item["reference"] == reference):
        value, limits = MEASURES[item["measure"]].difference(item)
        small = joined((element("small", limits), element("small", f"p = {item['p_holm']:.2g}")))
        head = element("strong", value) if item["p_holm"] < LEVEL else value
        lines.setdefault(item["controller"], []).append(joined((head, small)))
    caption = (
        f"Less {reference}: differences with limits, or trials in which it happened to the one only; p after "
        f"correction, bold below {LEVEL}."
    )
    heads = ["controller", *(m.heading for m in MEASURES.values() if m.compared)]
    return joined((element("p", caption), table(heads, [[k, *v] for k, v in lines.items()])))


def _motions(controllers: dict[str, Any]) -> Html:
    motions = sorted({motion for found in controllers.values() for motion in found["motions"]})
    lines = []
    for name, found in controllers.items():
        cells = [found["motions"][motion] for motion in motions]
        texts = [f"{c['contacts']} of {c['trials']}" for c in cells]
        limits = [f"{percent(c['interval'][0])} to {percent(c['interval'][1])} %" for c in cells]
        lines.append([name, *map(_cell, texts, limits)])
    return table(["trials with contact", *motions], lines)


def _worst(plan: Plan, name: str, cases: list[dict[str, Any]]) -> Html:
    lines = [
        (
            str(case["trial"]),
            *((case["contact_class"], case["contact_region"]) if case["contact"] else "--"),
            case["motion"],
            f"{1e3 * case['distance']:.0f}",
            f"{case['closing_speed']:.2f}" if case["contact"] else "-",
            f"{case['energy_share']:.2f}" if case["contact"] else "-",
            element("code", show_command(plan, case["trial"], name)),
        )
        for case in cases
    ]
    heads = (
        "trial",
        "contact",
        "part",
        "motion",
        "distance [mm]",
        "closing [m/s]",
        "energy / limit",
        "to see it again",
    )
    opened = {"open": ""} if name == "default" else {}
    return element("details", element("summary", name), table(heads, lines, (0, 1, 2, 3, 7)), **opened)


def _size(said: dict[str, Any]) -> str:
    return f"Here: {said['comparisons']:,} comparisons, {said['resamples']:,} resamples."


def _definitions() -> Iterator[Html]:
    shares = [(m.title, m.name, "trials", m.meaning) for m in SHARES]
    figures = [(m.title, m.name, m.unit, m.meaning) for m in FIGURES]
    heads = ("measure", "in JSON", "shown in", "definition")
    yield element("details", element("summary", "Measures"), table(heads, shares + figures, range(4)))
    columns = [(c.name, c.unit, c.meaning) for c in COLUMNS]
    yield element(
        "details", element("summary", "Columns of a row"), table(("column", "unit", "definition"), columns, range(3))
    )


def _words(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else "-" if value is None else str(value)


def _times(engine: dict[str, Any]) -> str:
    wall = "" if engine["wall_s"] is None else f", {engine['wall_s']:.0f} s from beginning to end"
    return (
        f"{engine['simulated_s']:,.0f} simulated seconds in {engine['processes_s']:,.0f} s of processes{wall}: "
        f"{engine['all_controllers_s_per_process_s']:.1f} simulated seconds a second and process."
    )
