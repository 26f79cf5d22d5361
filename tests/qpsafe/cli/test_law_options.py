"""A solver is refused where the law has no use for one, before anything is loaded."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.laws.by_name import LAWS, law_named


def test_only_laws_with_qps_take_a_solver() -> None:
    for name in LAWS:
        law_named(name)
        if name != "nullspace":
            law_named(name, solver="own")
    with pytest.raises(ConfigurationError, match=r"solver = 'own'.*nullspace"):
        law_named("nullspace", solver="own")


@pytest.mark.parametrize("demo", ["fixed", "pick-and-place"])
def test_the_demos_refuse_it_at_once(demo: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = demo.replace("-", "_")
    monkeypatch.setattr(f"qpsafe.cli.demos.{module}.any_robot", lambda *_, **__: pytest.fail("a robot was loaded"))
    words = ["demo", demo, "--law", "nullspace", "--solver", "own", "--out", str(tmp_path / "new")]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, ConfigurationError)
    assert "solver = 'own'" in str(result.exception)
    assert not (tmp_path / "new").exists()
