"""The manifest of a campaign's folder: whose trials these are, and what they were played with."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import Plan, identity_digest, names_only
from qpsafe.text.json_text import json_text, plain
from qpsafe.text.whole_file import whole_file

FORMAT = "qpsafe campaign 1"
MANIFEST = "manifest.json"
PACKAGES = ("qpsafe", "numpy", "scipy", "numba", "mujoco", "pin")


class Manifest(NamedTuple):
    """What a manifest says.

    Attributes:
        plan: As it was: what it names may have gone since.
        identity: Of the plan then, see `Plan.identity`.
        versions: Of Python and packages; several, separated by commas, where trials were added later with others.
    """

    plan: Plan
    identity: dict[str, Any]
    versions: dict[str, str]

    @property
    def digest(self) -> str:
        """64 hexadecimal digits that stand for the identity."""
        return identity_digest(self.identity)

    def write(self, folder: Path) -> None:
        """Into a folder, whole or not at all."""
        said = {"format": FORMAT, "plan": self.plan.placed(), "identity": self.identity, "versions": self.versions}
        with lasting_file(folder / MANIFEST) as part:
            part.write_text(json_text(said) + "\n", encoding="utf-8")

    def with_versions(self, now: dict[str, str]) -> Manifest:
        """The same after trials were added: versions that are new stand behind those that there were.

        Args:
            now: What they were played with.
        """
        found = dict(self.versions)
        for name, version in now.items():
            known = [word for word in found.get(name, "").split(", ") if word]
            found[name] = ", ".join(known if version in known else [*known, version])
        return self._replace(versions=found)


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder, checked.

    Raises:
        ConfigurationError: There is none, or it is wrong; names key and value.
    """
    file = folder / MANIFEST
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        assert said["format"] == FORMAT
        plan, identity, versions = (said[key] for key in ("plan", "identity", "versions"))
        assert isinstance(plan, dict)
        assert isinstance(identity, dict)
    except (OSError, ValueError, KeyError, TypeError, AssertionError, RecursionError) as error:
        problem = f"{type(error).__name__} {error}".strip()
        expected = f"a folder of a campaign, with a manifest: {FORMAT!r}"
        raise ConfigurationError(folder, MANIFEST, problem, expected) from None
    if not (isinstance(versions, dict) and all(isinstance(word, str) for word in versions.values())):
        raise ConfigurationError(file, "versions", versions, "a version, as text, for each name")
    try:
        found = Plan.stored(plan)
    except ConfigurationError as wrong:
        raise ConfigurationError(file, f"plan.{wrong.key}", wrong.value, wrong.expected) from None
    there = names_only(identity)  # older ones have paths
    for key, value in plain(found.named()).items():
        if there.get(key) != value:
            expected = f"{there.get(key)!r}, as in its identity: trials are of the plan that they were played by"
            raise ConfigurationError(file, f"plan.{key}", value, expected)
    return Manifest(found, identity, versions)


@contextmanager
def lasting_file(path: Path) -> Iterator[Path]:
    """As `whole_file`, and on the disk before it takes its place: a power cut leaves the old one or the new one."""
    with whole_file(path) as part:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())


def versions_now() -> dict[str, str]:
    """Versions of Python and the packages that decide numbers."""
    return {"python": platform.python_version()} | {name: metadata.version(name) for name in PACKAGES}
