"""Elements of a page as text, everything in them escaped: the one place where HTML is written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


def element(tag: str, *inside: str, **attributes: str) -> Html:
    """An element; what is inside is escaped unless it is HTML already.

    Args:
        tag: Its name.
        inside: Texts and elements.
        attributes: By name; an underscore at its end is left out, others are hyphens.
    """
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value, quote=True)}"' for name, value in attributes.items()
    )
    return Html(f"<{tag}{named}>{joined(inside)}</{tag}>")


def joined(parts: Iterable[str]) -> Html:
    """Texts and elements one after the other."""
    return Html("".join(part if isinstance(part, Html) else escape(part) for part in parts))


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], text: int = 1) -> Html:
    """A table that scrolls sideways where the screen is too narrow.

    Args:
        headings: Of the columns.
        rows: Their cells.
        text: How many columns at the left are text; the others are numbers.
    """
    heads = joined(element("th", cell, scope="col") for cell in headings)
    lines = (
        element(
            "tr",
            *(
                element("th", cell, scope="row")
                if k == 0
                else element("td", cell, class_="text" if k < text else "number")
                for k, cell in enumerate(row)
            ),
        )
        for row in rows
    )
    inner = element("table", element("thead", element("tr", heads)), element("tbody", *lines))
    return element("div", inner, class_="wide", tabindex="0")


STYLE = Html(
    """
:root { color-scheme: light; --line: #d6d9dd; --soft: #5b6570; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2126; background: #fff; margin: 0 auto; padding: 1.2rem;
  max-width: 62rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 2.2rem 0 .4rem; }
p, ul { margin: .4rem 0 .8rem; max-width: 46rem; } .soft, small { color: var(--soft); }
.wide { overflow-x: auto; margin: .6rem 0; overflow-wrap: normal; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .85rem; }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
thead th { vertical-align: bottom; border-bottom: 2px solid #9aa3ac; }
td.number { text-align: right; white-space: nowrap; } tbody th { white-space: nowrap; }
td small { display: block; white-space: nowrap; }
figure { margin: .8rem 0; overflow-x: auto; }
figure svg { width: 100%; min-width: 30rem; max-width: 50rem; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .85rem; max-width: 46rem; }
code { font: .82rem ui-monospace, monospace; background: #f2f4f6; padding: .05rem .25rem; border-radius: 3px; }
details { margin: .5rem 0; } summary { cursor: pointer; font-weight: 600; }
.fault { border-left: 4px solid #c0392b; background: #fdf0ee; padding: .5rem .8rem; }
.fine { border-left: 4px solid #2a8c3c; background: #f0f7f1; padding: .5rem .8rem; }
@page { size: A4 landscape; margin: 12mm; }
@media print { body { max-width: none; padding: 0; font-size: 9.5pt; } .wide { overflow: visible; }
  table { font-size: 6pt; } th, td { padding: .1rem .25rem; } figure, tr { break-inside: avoid; }
  thead { display: table-header-group; } }
"""
)


def page(title: str, *inside: str) -> str:
    """A whole page that needs nothing else.

    Args:
        title: Of the window.
        inside: Its elements.
    """
    head = element(
        "head",
        Html('<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'),
        element("title", title),
        element("style", STYLE),
    )
    return f'<!doctype html>\n<html lang="en">{head}{element("body", *inside)}</html>\n'
