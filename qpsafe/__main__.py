"""`python -m qpsafe`, and the `qpsafe` command: where the extra that it needs is missing, one line says so."""

from __future__ import annotations

import sys

from qpsafe.errors import MissingExtraError


def main() -> None:
    """Run the command line."""
    try:
        from qpsafe.cli.main import main as run
    except MissingExtraError as error:
        sys.exit(f"qpsafe: {error}")
    run()


if __name__ == "__main__":
    main()
