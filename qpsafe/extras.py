"""Optional dependencies, and the named error where one is not installed. A robot's computer needs none of them."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from qpsafe.errors import MissingExtraError


def require(extra: str, what: str, *modules: str) -> None:
    """Raise at once, naming the extra, if a module is not installed; nothing is imported.

    Args:
        extra: The extra of qpsafe that installs the modules, as in ``pip install 'qpsafe[extra]'``.
        what: What needs them; the message begins with it.
        modules: Names of the modules.

    Raises:
        MissingExtraError: Names the first that is missing, and the extra.
    """
    for module in modules:
        if not _is_there(module):
            raise MissingExtraError(f"{what} needs {module}: pip install 'qpsafe[{extra}]'")


def _is_there(module: str) -> bool:
    if module in sys.modules:
        return sys.modules[module] is not None
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):  # its package is missing, or somebody forbids it
        return False
