"""Command line of qpsafe: one file a command."""

from qpsafe.extras import require

require("cli", "the command line", "typer", "rich")
