"""`python -m qpsafe`, and the `qpsafe` command: one line says which extra is missing, if one is."""

from __future__ import annotations

import shlex
import sys

from qpsafe.errors import MissingExtraError


def main() -> None:
    """Run the command line."""
    try:
        from qpsafe.cli.main import main as run
    except MissingExtraError as error:
        here = shlex.join(["qpsafe", *sys.argv[1:]])
        sys.exit(
            f"qpsafe: {error}, or 'qpsafe[sim]' for the demos (without installing: uvx --from 'qpsafe[sim]' {here})"
        )
    run()


if __name__ == "__main__":
    main()
