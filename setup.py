"""Packages are found, not listed: pyproject.toml names the four folders, and each brings the packages inside it."""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup

FOLDERS = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["package-dir"]

setup(packages=sorted({p for top, at in FOLDERS.items() for p in (top, *(f"{top}.{x}" for x in find_packages(at)))}))
