"""What docs/how-to/web.md says was measured stands in docs/data/web.json."""

from __future__ import annotations

import json
from pathlib import Path

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_numbers_of_the_page_are_those_that_were_measured() -> None:
    measured = json.loads((DOCS / "data" / "web.json").read_text("utf-8"))
    page = (DOCS / "how-to" / "web.md").read_text("utf-8")
    for name, key in (("without a page", "without"), ("with the page open in Chromium", "with")):
        found = measured[key]
        times = [found["tick"]["p50"], found["tick"]["p99.9"], found["cycle"]["p50"], found["cycle"]["p99.9"]]
        assert f"| {name} | " + " | ".join(f"{1e3 * seconds:.2f} ms" for seconds in times) + " |" in page
    said = " ".join(page.split())
    assert f"it took {1e3 * measured['drag']['median']:.0f} ms in the median" in said
    assert f"{1e3 * measured['drag']['p90']:.0f} ms in nine of ten cases" in said
    assert f"{measured['seconds']:.0f} s each" in said
    assert f"(load {measured['load']:.0f})" in said
    assert measured["fifo"] is True
