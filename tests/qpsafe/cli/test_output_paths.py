"""Every output path of every command is tried before the work starts, and named if nothing can be written there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
import typer
import typer.main
from amounts import some

from qpsafe.cli import main
from qpsafe.cli.outputs import try_file, try_folder
from qpsafe.errors import ConfigurationError

APP: Any = typer.main.get_command(main.app)
#: Paths that are read; every other path of the command line must be one that is written.
INPUTS = {"story", "program", "people", "cell", "file", "folder", "plan"}


def path_parameters(app: typer.Typer = main.app, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Words and option of every path of the command line that is not an input."""
    for group in app.registered_groups:
        assert group.typer_instance is not None
        yield from path_parameters(group.typer_instance, (*words, str(group.name)))
    for command in app.registered_commands:
        assert command.callback is not None
        here = (*words, command.name or command.callback.__name__)
        for name, kind in get_type_hints(command.callback).items():
            if (kind is Path or Path in get_args(kind)) and name not in INPUTS:
                (option,) = (parameter for parameter in found(here).params if parameter.name == name)
                yield here, option


def found(words: tuple[str, ...]) -> Any:
    command = APP
    for word in words:
        command = command.commands[word]
    return command


OUTPUTS = list(path_parameters())
IDS = [f"{words[-1]} {parameter.name}" for words, parameter in OUTPUTS]
ENDINGS = (".json", ".toml", ".csv", ".png", ".mp4")


def test_the_outputs_are_those_of_all_commands() -> None:
    assert {(words[-1], parameter.name) for words, parameter in OUTPUTS} == {
        *((demo, "out") for demo in ("fixed", "path", "fast-person", "pick-and-place", "place")),
        *((campaign, "out") for campaign in ("run", "show", "worst", "report")),
        *(("calibrate", name) for name in ("out", "plot")),
        *(
            ("bench", "out"),
            ("calibrate-camera", "out"),
            ("check", "out"),
            ("tune", "out"),
            ("add", "out"),
            ("story", "plot"),
            ("replay", "video"),
            ("web", "out"),
            ("stream", "log"),
            ("irc5-sim", "log"),
        ),
    }


def bad_paths(folder: Path) -> dict[str, Path]:
    """Where nobody can write, root neither; a name without an ending is a folder's."""
    (folder / "file").write_text("kept")
    (folder / "folder").mkdir()
    for ending in ENDINGS:
        (folder / f"folder{ending}").mkdir()
    return {
        "below a file": folder / "file" / "new",
        "far below a file": folder / "file" / "a" / "b",
        "of the kernel": Path("/proc/qpsafe"),
        "below the kernel's": Path("/proc/self/qpsafe"),
        "too long": folder / (300 * "n"),
        "parts too long": folder / (300 * "n") / "new",
    }


def begun(**_: object) -> None:
    pytest.fail("the work has begun")


def invoke(words: tuple[str, ...], parameter: Any, path: Path) -> None:
    """Call the command with nothing but the path; arguments that it needs are there, its work is not."""
    command = found(words)
    arguments = ["x" for other in command.params if other.param_type_name == "argument" and other.required]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "callback", begun)
        APP(args=[*words, *arguments, parameter.opts[0], str(path)], prog_name="qpsafe", standalone_mode=False)


@pytest.mark.parametrize(("words", "parameter"), OUTPUTS, ids=IDS)
def test_a_bad_output_path_is_named_before_the_work_starts(
    words: tuple[str, ...], parameter: Any, tmp_path: Path
) -> None:
    bad = bad_paths(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    folder = "older" in parameter.help
    wrong = list(bad.values())
    if folder:
        wrong += [tmp_path / "file"]
    else:
        wrong = [path.with_name(path.name + ending) for path in wrong for ending in ENDINGS]
        wrong += [tmp_path / "folder", *(tmp_path / f"folder{ending}" for ending in ENDINGS), Path("/dev/null")]
        wrong += [tmp_path / "nowhere" / f"new{ending}" for ending in ENDINGS]
    for path in wrong:
        with pytest.raises(ConfigurationError) as refused:
            invoke(words, parameter, path)
        assert str(refused.value).startswith(
            f"qpsafe {' '.join(words)}: {parameter.opts[0]} = {str(path)!r}: expected a f"
        )
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize(("words", "parameter"), OUTPUTS, ids=IDS)
def test_a_good_output_path_leads_to_the_work_and_leaves_no_trace(
    words: tuple[str, ...], parameter: Any, tmp_path: Path
) -> None:
    (tmp_path / "old.csv").write_text("kept")
    reached, refused = 0, []
    names = ["new", "a/b/c", "."] if "older" in parameter.help else [f"new{ending}" for ending in ENDINGS] + ["old.csv"]
    for name in names:
        try:
            invoke(words, parameter, tmp_path / name)
        except pytest.fail.Exception:
            reached += 1
        except ConfigurationError as error:
            refused.append(str(error))
    assert reached
    assert all("that ends in" in text for text in refused)
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]
    assert (tmp_path / "old.csv").read_text() == "kept"


def test_what_is_there_already_is_not_touched(tmp_path: Path) -> None:
    file = tmp_path / "old.toml"
    file.write_text("kept")
    seen = file.stat()
    try_file("here", "--out", file, ".toml")
    try_folder("here", "--out", tmp_path)
    assert file.stat() == seen
    assert list(tmp_path.iterdir()) == [file]


def test_calibrate_tries_the_robots_folder_before_it_reads_the_pairs(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("")
    (tmp_path / "calibration.toml").mkdir()
    with pytest.raises(ConfigurationError, match=r"--robot = .*calibration\.toml"):
        typer.main.get_command(main.app)(
            args=["calibrate", "none.csv", "--robot", str(tmp_path)], prog_name="qpsafe", standalone_mode=False
        )


def test_a_disk_that_is_full_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, os.strerror(28), str(tmp_path / "x.json"))

    monkeypatch.setattr(main, "app", full)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    with pytest.raises(SystemExit) as left:
        main.main()
    assert left.value.code == 1
    assert capsys.readouterr().err == f"qpsafe: {tmp_path / 'x.json'}: No space left on device\n"


def test_those_who_try_one_folder_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    path = tmp_path / "out" / "place"
    with ThreadPoolExecutor(4) as pool:
        for tried in [pool.submit(try_folder, "here", "--out", path) for _ in range(some(400, of=2000))]:
            tried.result()
    assert not any(left.is_file() for left in tmp_path.rglob("*"))  # who made a folder may find it in use
