"""What was measured, and is kept: docs/data/NAME.json, which the pages are filled from and held to."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from qpsafe.text.json_text import json_text

DOCS = Path(__file__).resolve().parent
DATA = DOCS / "data"


def measured(name: str) -> Any:
    """What docs/data/NAME.json says."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def rounded(value: Any) -> Any:
    """The same with six significant digits: pages show fewer."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return [rounded(item) for item in value] if isinstance(value, list | tuple) else value


def note(name: str, found: Any) -> None:
    """Write docs/data/NAME.json.

    Args:
        name: Of the file.
        found: What was measured, rounded before it is written.
    """
    (DATA / f"{name}.json").write_text(json_text(rounded(found), indent=1) + "\n", encoding="utf-8")


def unsaid(page: str, sentences: Iterable[str]) -> list[str]:
    """Those of some sentences that a page does not say.

    Args:
        page: Its path in docs.
        sentences: Or parts of them, with single blanks and nothing bold.
    """
    text = " ".join((DOCS / page).read_text(encoding="utf-8").replace("**", "").split())
    return [sentence for sentence in sentences if sentence not in text]
