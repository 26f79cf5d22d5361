"""Writing a figure of matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def save(figure: Any, path: Path) -> None:
    """Write whole or not at all."""
    part = path.with_name("." + path.name)
    try:
        figure.savefig(part, format=path.suffix.lstrip("."))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
