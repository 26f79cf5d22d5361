"""Tables of the command line: plain text in which no word, and so no number, is ever cut, however narrow the screen."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

from rich import box
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions

COMFORT = 20  # columns below which text is not squeezed while something else can give way
GAP = 2  # columns between two cells


class Sheet:
    """A table, shown as rows one below the other where the screen is too narrow for it.

    Text may be wrapped between words. Numbers stand to the right and are never wrapped. Nothing is read as markup:
    brackets in names from files, or units in headings, are shown as they are.

    Args:
        title: Above it.
        headings: Of the columns.
        text: Which columns are text, by number; the others are numbers.
    """

    def __init__(self, title: str, headings: Sequence[str], text: Collection[int] = (0,)) -> None:
        self.title, self.headings, self.text = title, tuple(headings), frozenset(text)
        self.rows: list[tuple[Text, ...]] = []

    def add_row(self, *cells: str | Text) -> None:
        """Append a row: plain text, or rich's `Text` where something is coloured."""
        if len(cells) != len(self.headings):
            raise ValueError(f"{self.title}: {len(cells)} cells for {len(self.headings)} headings")
        self.rows.append(tuple(cell if isinstance(cell, Text) else Text(cell) for cell in cells))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Any]:
        yield Text(self.title, style="bold")
        widths = self._widths(options.max_width)
        if widths is None:
            yield from self._stacked(options.max_width)
            return
        table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
        for number, (heading, width) in enumerate(zip(self.headings, widths, strict=True)):
            table.add_column(Text(heading), width=width, justify="left" if number in self.text else "right")
        for row in self.rows:
            table.add_row(*row)
        yield table
        yield Text("")

    def _widths(self, room: int) -> list[int] | None:
        """Widths of the columns, the widest ones narrowed first; None if words or numbers do not fit."""
        widths, least = [], []
        for number, heading in enumerate(self.headings):
            cells = [line for row in self.rows for line in row[number].plain.split("\n")]
            whole = [] if number in self.text else cells  # what is not wrapped
            words = chain.from_iterable(line.split() for line in [heading, *cells])
            widest = max(map(cell_len, [heading, *cells]))
            needed = max(map(cell_len, [*whole, *words]), default=1)
            widths.append(max(widest, 1))
            least.append(max(needed, min(widest, COMFORT) if number in self.text else 1))
        while sum(widths) + GAP * len(widths) - 1 > room:
            wide = [number for number, width in enumerate(widths) if width > least[number]]
            if not wide:
                return None
            widths[max(wide, key=lambda number: widths[number])] -= 1
        return widths

    def _stacked(self, room: int) -> Iterator[Text]:
        """Every row as its values with their headings, as many on a line as there is room for."""
        for row in self.rows:
            yield Text("")
            line = Text("")
            for heading, cell in zip(self.headings, row, strict=True):
                parts = [part[len(part) - len(part.plain.lstrip()) :] for part in cell.split("\n")]
                value = Text("; ").join(parts)
                item = Text.assemble(f"{heading}: " if heading else "", value)
                if line and cell_len(line.plain) + GAP + cell_len(item.plain) > room:
                    yield line
                    line = Text(GAP * " ")
                elif line:
                    line.append(GAP * " ")
                line.append_text(item)
            yield line
        yield Text("")
