"""What pydantic expected, in the words of a file that a person wrote: no names of its own types and models."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def expected_words(problem: ErrorDetails) -> str:
    """What was expected instead of a value, to stand after `expected`."""
    kind, said, context = problem["type"], problem["msg"], problem.get("ctx", {})
    if kind in ("missing", "union_tag_not_found"):
        return "a value: this key is missing"
    if kind == "extra_forbidden":
        return "no such key (misspelt, or in the wrong table?)"
    if kind == "literal_error":
        return str(context["expected"])
    if kind == "union_tag_invalid":
        return f"one of {context['expected_tags']}"
    if kind in ("model_attributes_type", "model_type", "dict_type"):
        return "a table"
    said = re.sub(r"^(Input should be |Value error, )", "", said)
    return re.sub(r"^(\w+) should have (.*?)( after validation.*)?$", _with, said)


def _with(match: re.Match[str]) -> str:
    noun = {"Dictionary": "table", "Tuple": "list"}.get(match.group(1), match.group(1).lower())
    return f"a {noun} with {match.group(2)}"
