"""Draw docs/img/placement-*.png: `qpsafe place` for the IRB 140 as it is shipped, and its pictures."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

IMG = Path(__file__).parent / "img"
FIGURES = {"figure-9.png": "placement-figure-9", "nodes.png": "placement-nodes", "spots.png": "placement-spots"}


def main() -> None:
    """Run the command and take its figures."""
    with tempfile.TemporaryDirectory() as folder:
        code = "from qpsafe.cli.main import main; main()"
        subprocess.run([sys.executable, "-c", code, "place", "--no-exact", "--out", folder], check=True)
        for name, target in FIGURES.items():
            shutil.copy(Path(folder) / name, IMG / f"{target}.png")


if __name__ == "__main__":
    main()
