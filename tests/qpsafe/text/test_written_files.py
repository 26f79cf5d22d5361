"""What is written: text as a string of TOML, and files that are there whole or not at all."""

from __future__ import annotations

import multiprocessing
import os
import tomllib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from qpsafe.cli.common import write_text
from qpsafe.cli.outputs import try_file
from qpsafe.errors import ConfigurationError
from qpsafe.sensing.sharp import SharpCurve
from qpsafe.sensing.skin.calibration import Fit, calibration_text, read_calibration
from qpsafe.text.figure_file import save
from qpsafe.text.toml_string import toml_string
from qpsafe.text.whole_file import whole_file


@given(st.text())
@example("".join(map(chr, [*range(0x20), *range(0x7F, 0xA0), 0x2028, 0xFEFF])) + "\"'\\ #\r\n")
def test_any_text_is_a_string_of_toml(text: str) -> None:
    assert tomllib.loads(f"{toml_string(text)} = {toml_string(text)}") == {text: text}
    assert "\n" not in toml_string(text)


@pytest.mark.parametrize(
    "name", ["fore\narm", "\r\n", "\x00\x1b\x7f", '"quoted" \\', "\x85\u2028", "Ellenbogen größer"]
)
def test_curves_are_read_back_whatever_the_spot_is_called(name: str, tmp_path: Path) -> None:
    curve = SharpCurve()
    d = np.linspace(0.2, 0.8, 7)
    write_text(tmp_path / "c.toml", calibration_text([Fit(name, curve, d, curve.voltage(d), 0)], sensor=name))
    assert list(read_calibration(tmp_path / "c.toml")) == [name]


class _Interrupted(BaseException):
    pass


class _Figure:
    """Of matplotlib, as far as `save` knows one."""

    def __init__(self, text: str) -> None:
        self.text = text

    def savefig(self, path: Path, format: str) -> None:
        path.write_text(self.text + format)
        if self.text == "interrupted":
            raise _Interrupted


@pytest.mark.parametrize("problem", [ValueError, KeyboardInterrupt, _Interrupted])
def test_what_is_not_finished_leaves_the_old_file(problem: type[BaseException], tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def write() -> None:
        with whole_file(path) as part:
            part.write_text("ne")
            raise problem

    with pytest.raises(problem):
        write()
    assert path.read_text() == "old"
    with pytest.raises(_Interrupted):
        save(_Figure("interrupted"), tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == [path]


def _write_often(folder: Path) -> None:
    text = f"{os.getpid()}" * 1000
    for _ in range(100):
        write_text(folder / "report.json", text)
        save(_Figure(text), folder / "figure.png")


def test_two_processes_that_write_one_file_do_not_meet(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork" if os.name == "posix" else "spawn")
    both = [context.Process(target=_write_often, args=(tmp_path,)) for _ in range(2)]  # type: ignore[attr-defined]
    for process in both:
        process.start()
    for process in both:
        process.join()
    assert [process.exitcode for process in both] == [0, 0]
    whole = {f"{process.pid}" * 1000 for process in both}
    assert (tmp_path / "report.json").read_text() in whole
    assert (tmp_path / "figure.png").read_text().removesuffix("png") in whole
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("length", range(235, 256))
def test_a_name_that_was_tried_can_be_written(length: int, tmp_path: Path) -> None:
    path = tmp_path / (length * "n")
    with suppress(ConfigurationError):  # too long is said before the work
        try_file("here", "--out", path)
        write_text(path, "written")
        assert path.read_text() == "written"
