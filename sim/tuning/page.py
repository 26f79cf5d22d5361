"""The report of a tuning: one page with everything in it."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Any

from qpsafe.sim.campaign.report.figures import svg
from qpsafe.sim.campaign.report.html import Html, element, page, table
from qpsafe.sim.campaign.report.measures import MEASURES
from qpsafe.sim.tuning import objectives
from qpsafe.sim.tuning.figures import front_figure, sensitivity_figure
from qpsafe.text.words import counted

_MEANS = {"harm": ("harm", "{:.4f}"), "lost": ("work lost [s]", "{:.2f}"), "reversals": ("reversals", "{:.1f}")}


def tuning_page(said: dict[str, Any]) -> str:
    """The page of a result, see `qpsafe.sim.tuning.result`."""
    return page(f"Tuning of {said['robot']}", *_sections(said))


def _sections(said: dict[str, Any]) -> Iterator[Html]:
    whole = sum(trial["whole"] for trial in said["trials"])
    first, last = said["search"]["encounters"]
    yield element("h1", f"Tuning of {said['robot']}: {counted(len(said['trials']), 'trial')}")
    yield element(
        "p",
        f"Search {said['search']['seed']}: all met the same people, seeds {first} to {last}; {whole:,} met all of "
        "them, the others were stopped early. Each objective is a mean over encounters.",
        class_="soft",
    )
    if said["finals"] is not None:
        yield element("p", _finals(said), class_="soft")
    taken = said["judgement"] is not None and said["judgement"]["worth"]
    yield element("p", said["sentence"], class_="fine" if taken or said["chosen"]["number"] == 0 else "fault")
    yield element("h2", "The front")
    yield _figure(svg(front_figure(said), "front"), "Best is down left.")
    yield _front(said)
    if said["judgement"] is not None:
        yield element("h2", "Chosen against present, on encounters that nothing was tuned on")
        yield from _judged(said["judgement"])
    yield element("h2", "Values")
    yield _values(said)
    if said["sensitivity"]:
        yield element("h2", "What matters")
        caption = "PED-ANOVA: how differently the better quarter of the trials is spread along a coordinate than all."
        yield _figure(svg(sensitivity_figure(said["sensitivity"]), "matters"), caption)
    yield element("h2", "Where was looked")
    cells = [(d["name"], f"{d['low']:.4g}", f"{d['high']:.4g}", d["reason"]) for d in said["space"]]
    yield table(("coordinate", "from", "to", "reason"), cells, (0, 3))
    yield element("h2", "How it was counted")
    yield element("pre", (objectives.__doc__ or "").strip())
    yield table(("key", "value"), [(key, str(value)) for key, value in said["plan"].items()], range(2))
    yield element("p", f"Run: {said['run']}; {said['search']['processor_s']:,.0f} s of processes.", class_="soft")


def _finals(said: dict[str, Any]) -> str:
    (first, last), some = said["finals"]["encounters"], len(said["finals"]["finalists"]) - 1
    return (
        f"Finals: {counted(some, 'trial')} and the present values met {last - first + 1:,} others, seeds {first} to "
        f"{last}. The front, the choice and their figures are of these."
    )


def _figure(image: str, caption: str) -> Html:
    return element("figure", Html(image), element("figcaption", caption))


def _front(said: dict[str, Any]) -> Html:
    rows = []
    for name, point in (("present", said["present"]), *((f"trial {p['number']}", p) for p in said["front"])):
        chosen = point["number"] == said["chosen"]["number"] and name != "present"
        rows.append((name + (" (chosen)" if chosen else ""), f"{point['harm']:.4f}", f"{point['lost']:.3f}"))
    return table(("", "harm", "work lost [s]"), rows)


def _judged(said: dict[str, Any]) -> Iterator[Html]:
    rows = []
    for key, (title, form) in _MEANS.items():
        mean = said["means"][key]
        limits = "no limits"  # of too few encounters
        if isfinite(mean["low"]):
            limits = f"{form.format(mean['low'])} to {form.format(mean['high'])}"
        shown = (form.format(mean[name]) for name in ("present", "tuned", "value"))
        rows.append((title, *shown, limits, f"{mean['p']:.2g}"))
    yield table(("mean of", "present", "tuned", "difference", "95 %", "p"), rows)
    shares = [
        (MEASURES[key].title, f"{s['present']:,}", f"{s['tuned']:,}", f"+{s['only_first']} -{s['only_second']}",
         f"{s['p']:.2g}")
        for key, s in said["shares"].items()
    ]  # fmt: skip
    heads = (f"of {said['encounters']:,} encounters with", "present", "tuned", "to one only", "p")
    yield table(heads, shares)
    yield element("p", "Means: paired bootstrap; encounters with: McNemar's test, exact.", class_="soft")


def _values(said: dict[str, Any]) -> Html:
    rows = []
    for name, keys in said["present"]["values"].items():
        for key, value in keys.items():
            rows.append((f"[{name}] {key}", _shown(value), _shown(said["chosen"]["values"][name][key])))
    return table(("", "present", "chosen"), rows, (0,))


def _shown(value: Any) -> str:
    return ", ".join(f"{x:.4g}" for x in value) if isinstance(value, tuple | list) else f"{value:.4g}"
