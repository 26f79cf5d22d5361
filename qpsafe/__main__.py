"""`python -m qpsafe`, and the `qpsafe` command: one line says which extras are missing, if the command line's are."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence

from qpsafe.errors import MissingExtraError

#: Extras that a command needs; the others need "sim".
EXTRAS = {
    "bench": "bench",
    "calibrate": "cli",
    "campaign": "campaign",
    "irc5-faults": "sim,irc5",
    "irc5-sim": "sim,irc5",
    "place": "place",
    "robots": "cli",
    "stream": "cli,irc5",
    "tune": "tune",
    "web": "web",
}


def without_installing(words: Sequence[str]) -> str:
    """How to run a command with all that it needs in an environment of its own, which uv or pipx makes.

    Args:
        words: What follows ``qpsafe`` on the command line.
    """
    name = next((word for word in words if not word.startswith("-")), "")
    source, command = f"'qpsafe[{EXTRAS.get(name, 'sim')}]'", shlex.join(["qpsafe", *words])
    return f"uvx --from {source} {command}, or pipx run --spec {source} {command}"


def main() -> None:
    """Run the command line."""
    try:
        from qpsafe.cli.main import main as run
    except MissingExtraError as error:
        sys.exit(f"qpsafe: {error}; without installing: {without_installing(sys.argv[1:])}")
    run()


if __name__ == "__main__":
    main()
