"""Fill the tables of docs/campaign.md and README.md from docs/data/campaign.json: python docs/campaign_tables.py."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from qpsafe.sim.campaign.report.markdown import filled

DOCS = Path(__file__).resolve().parent
PAGES = (DOCS / "campaign.md", DOCS.parent / "README.md")
DATA = DOCS / "data" / "campaign.json"


def committed() -> dict[str, Any] | None:
    """The campaign's summary that the pages quote; None if there is none yet."""
    return json.loads(DATA.read_text(encoding="utf-8")) if DATA.exists() else None


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8"), committed()), encoding="utf-8")
