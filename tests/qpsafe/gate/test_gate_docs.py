"""What the page says the gate takes is what the benchmark wrote."""

from __future__ import annotations

import json
from pathlib import Path

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_times_on_the_page_are_those_of_the_benchmark() -> None:
    page = " ".join((DOCS / "explanation" / "verified-motion.md").read_text(encoding="utf-8").split())
    found = json.loads((DOCS / "data" / "gate.json").read_text(encoding="utf-8"))
    near, nobody = found["a person in reach"], found["nobody near"]
    assert (
        f"A tick of {nobody['neither']:.0f} µs with nobody near takes {nobody['gate'] - nobody['neither']:.1f} µs"
        in page
    )
    assert f"one of {near['neither']:.0f} µs with a person in reach {near['gate'] - near['neither']:.1f} µs" in page
    assert nobody["gate"] - nobody["neither"] <= 2.0
    assert near["gate"] - near["neither"] <= 40.0
