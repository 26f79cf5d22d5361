"""Attributes that are set once. Compiled code keeps copies of them: a change would be ignored, so it is refused."""

from __future__ import annotations

from inspect import isfunction
from typing import Any, ClassVar

import numpy as np

from qpsafe.errors import ConfigurationError


class Fixed:
    """Base class of immutable parts: to change a number, make another part.

    Arrays among the attributes become read-only, so they must be the part's own. Methods cannot be replaced on a single
    object either: compiled code would not call them. Reading costs nothing.
    """

    #: Names of the attributes that are given once; None for every public one.
    fixed: ClassVar[frozenset[str] | None] = None

    def __setattr__(self, key: str, value: Any) -> None:
        kind = type(self)
        if self._is_fixed(key) and key in self.__dict__:
            raise ConfigurationError(kind.__name__, key, value, f"no change: make another {kind.__name__} instead")
        if isfunction(getattr(kind, key, None)):
            raise ConfigurationError(kind.__name__, key, value, f"no change of one object: derive from {kind.__name__}")
        if isinstance(value, np.ndarray) and self._is_fixed(key):
            value.flags.writeable = False
        object.__setattr__(self, key, value)

    def __delattr__(self, key: str) -> None:
        if self._is_fixed(key):
            raise ConfigurationError(type(self).__name__, key, "deleted", "no change")
        object.__delattr__(self, key)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickled and copied arrays can be written to again."""
        self.__dict__.update(state)
        for key, value in state.items():
            if isinstance(value, np.ndarray) and self._is_fixed(key):
                value.flags.writeable = False

    @classmethod
    def _is_fixed(cls, key: str) -> bool:
        return not key.startswith("_") if cls.fixed is None else key in cls.fixed
