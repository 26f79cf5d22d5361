"""Tables of any words at any width: no word is lost or cut."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.cli.sheet import Sheet

words = st.text(st.sampled_from("ab1.[]/:+-"), min_size=1, max_size=9)
cells = st.lists(words, min_size=1, max_size=4).map(" ".join)


@settings(max_examples=some(10, of=60))
@given(data=st.data(), width=st.integers(44, 120))
def test_no_word_of_a_sheet_is_lost_or_cut(whole: Callable[[Sheet, int], str], data: st.DataObject, width: int) -> None:
    count = data.draw(st.integers(1, 9))
    row = st.lists(words | cells, min_size=count, max_size=count)
    text = data.draw(st.sets(st.integers(0, count - 1)))
    sheet = Sheet(data.draw(cells), data.draw(row), text)
    for line in data.draw(st.lists(row, min_size=1, max_size=4)):
        sheet.add_row(*(cell if number in text else cell.split()[0] for number, cell in enumerate(line)))
    whole(sheet, width)


def test_a_sheet_is_a_table_where_it_fits_and_never_wraps_a_number(whole: Callable[[Sheet, int], str]) -> None:
    sheet = Sheet("t", ("what", "first number [mm]", "second [1/s]"))
    sheet.add_row("a name of several words", "1 234.5 %", "-0.25")
    assert "1 234.5 %" in whole(sheet, 80).splitlines()[3]
    assert "first number [mm]: 1 234.5 %" in whole(sheet, 32)
    with pytest.raises(ValueError, match="2 cells for 3"):
        sheet.add_row("a", "b")
