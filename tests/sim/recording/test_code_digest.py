"""The digest of the code stands for what decides a run, however the code is laid out, and for nothing else."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qpsafe.sim.recording.digest import code_digest, deciding, files_digest

PACKAGES = ("a", "a.tasks", "a.sim")
files = st.dictionaries(
    st.tuples(st.sampled_from(PACKAGES), st.sampled_from(["x.py", "world/y.py", "world/z.toml", "m.urdf", "b.xml"])),
    st.binary(max_size=8),
    min_size=1,
)


def laid_out(root: Path, contents: dict[tuple[str, str], bytes], *, wheel: bool) -> str:
    """The digest of packages that lie within each other, or side by side as in a clone."""
    packages = []
    for name in PACKAGES:
        folder = root / (name.replace(".", "/") if wheel else name.rpartition(".")[2])
        folder.mkdir(parents=True, exist_ok=True)
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        packages.append(package)
        for (of, file), data in contents.items():
            if of == name:
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(data)
    for noise in ("__pycache__/x.pyc", "cli/x.py", "drawing/x.py", "notes.md"):
        (Path(packages[0].__path__[0]) / noise).parent.mkdir(exist_ok=True)
        (Path(packages[0].__path__[0]) / noise).write_text(str(wheel), encoding="utf-8")
    return files_digest(deciding(packages))


@given(contents=files, data=st.data())
@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_clone_and_a_wheel_have_one_digest_and_any_change_another(
    contents: dict[tuple[str, str], bytes], data: st.DataObject, tmp_path_factory: object
) -> None:
    def folder() -> Path:
        return tmp_path_factory.mktemp("code")  # type: ignore[attr-defined,no-any-return]

    was = laid_out(folder(), contents, wheel=True)
    assert was == laid_out(folder(), contents, wheel=False)
    key = data.draw(st.sampled_from(sorted(contents)))
    assert was != laid_out(folder(), contents | {key: contents[key] + b" "}, wheel=False)


def test_the_code_of_now_has_one() -> None:
    assert len(code_digest()) == 64
    assert code_digest() == code_digest.__wrapped__()
