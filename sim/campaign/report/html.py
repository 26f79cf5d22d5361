"""Elements of a page as text, everything in them escaped: the one place where HTML is written."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
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


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], text: Collection[int] = (0,)) -> Html:
    """A table that scrolls sideways where the screen is too narrow; its first column stays.

    Args:
        headings: Of the columns.
        rows: Their cells.
        text: Numbers of the columns that are text; the others are numbers.
    """
    kinds = ["text" if k in text else "number" for k in range(len(headings))]
    heads = joined(element("th", cell, scope="col", class_=kind) for cell, kind in zip(headings, kinds, strict=True))
    lines = (
        element(
            "tr",
            element("th", _breakable(row[0]), scope="row"),
            *(element("td", cell, class_=kind) for cell, kind in zip(row[1:], kinds[1:], strict=True)),
        )
        for row in rows
    )
    inner = element("table", element("thead", element("tr", heads)), element("tbody", *lines))
    return element("div", inner, class_="wide", tabindex="0")


def _breakable(name: str) -> Html:
    """A name that may go on in another line after its underscores, slashes and colons."""
    return Html(re.sub(r"([_/:])", r"\1<wbr>", escape(name)))


STYLE = Html(
    """
:root { color-scheme: light; --line: #d6d9dd; --soft: #5b6570; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2126; background: #fff; margin: 0 auto; padding: 1.2rem;
  max-width: 74rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 2.2rem 0 .4rem; }
h2 { break-after: avoid; } p, ul { margin: .4rem 0 .8rem; max-width: 46rem; } .soft, small { color: var(--soft); }
.wide { overflow-x: auto; margin: .6rem 0; overflow-wrap: normal; }
table { border-collapse: separate; border-spacing: 0; font-variant-numeric: tabular-nums; font-size: .85rem; }
th, td { padding: .25rem .5rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
thead th { vertical-align: bottom; border-bottom: 2px solid #9aa3ac; } .number { text-align: right; }
td.number, td code, tbody th { white-space: nowrap; }
th:first-child { position: sticky; left: 0; background: #fff; }
td small { display: block; white-space: nowrap; }
figure { margin: .8rem 0; overflow-x: auto; }
figure svg { width: 100%; min-width: 34rem; max-width: 50rem; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .85rem; max-width: 46rem; }
code { font: .82rem ui-monospace, monospace; background: #f2f4f6; padding: .05rem .25rem; border-radius: 3px; }
details { margin: .5rem 0; } summary { cursor: pointer; font-weight: 600; }
.fault { border-left: 4px solid #c0392b; background: #fdf0ee; padding: .5rem .8rem; }
.fine { border-left: 4px solid #2a8c3c; background: #f0f7f1; padding: .5rem .8rem; }
@page { size: A4 landscape; margin: 12mm; }
@media (max-width: 40rem) { body { padding: .8rem; } h1 { font-size: 1.35rem; } ul { padding-left: 1.2rem; }
  tbody th { white-space: normal; } }
@media print { body { max-width: none; padding: 0; font-size: 9.5pt; } .wide, figure { overflow: visible; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; } th:first-child { position: static; }
  table { font-size: 6.5pt; } th, td { padding: .1rem .25rem; } table code { font-size: inherit; padding: 0; }
  td.text:not(:has(code)), td.number { max-width: 22rem; } figure, tr, .fault, .fine { break-inside: avoid; }
  figure svg { min-width: 0; max-width: 16cm; } thead { display: table-header-group; }
  details::details-content { content-visibility: visible; block-size: auto; } }
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
