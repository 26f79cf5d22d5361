"""What tests of printed tables share."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable

import pytest
from rich.cells import cell_len
from rich.console import Console

from qpsafe.cli.sheet import Sheet


@pytest.fixture(scope="session")
def whole() -> Callable[[Sheet, int], str]:
    """A sheet as a screen of some width shows it, checked: nothing of it is lost or cut."""
    return _whole


def _whole(sheet: Sheet, width: int) -> str:
    """Every word is there, as often as in the cells; numbers are in one piece; nothing is wider than the screen."""
    out = io.StringIO()
    Console(file=out, width=width, markup=False, emoji=False, highlight=False).print(sheet)
    text = out.getvalue()
    assert "…" not in text
    assert max(map(cell_len, text.splitlines())) <= width
    found = Counter(word.rstrip(";") for word in text.split())
    plain = [cell.plain for row in sheet.rows for cell in row]
    assert not Counter(" ".join(plain).split()) - found
    heads = {word.rstrip(":") for word in found}
    assert not {word.rstrip(":") for word in " ".join([sheet.title, *sheet.headings]).split()} - heads
    for row in sheet.rows:
        for number, cell in enumerate(row):
            if number not in sheet.text:
                assert all(line.strip() in text for line in cell.plain.split("\n"))
    return text
