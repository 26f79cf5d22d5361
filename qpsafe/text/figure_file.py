"""Writing a figure of matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qpsafe.text.whole_file import whole_file


def save(figure: Any, path: Path) -> None:
    """Write whole or not at all."""
    with whole_file(path) as part:
        figure.savefig(part, format=path.suffix.lstrip("."))
