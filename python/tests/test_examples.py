"""The examples do what they say: the mended simulation is nearer to the robot."""

import importlib.util
import json
import subprocess
import sys

import pytest
from conftest import EXAMPLES

FOLDER = EXAMPLES / "python"


def distances(name, monkeypatch, tmp_path):
    """What an example's `main` returns."""
    monkeypatch.chdir(tmp_path)
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main()


@pytest.mark.filterwarnings("ignore::flexspline.FormatWarning")
def test_mujoco(monkeypatch, tmp_path):
    pytest.importorskip("mujoco")
    before, after = distances("mujoco_arm", monkeypatch, tmp_path)
    assert (before > 30).all()
    assert (after < 0.05 * before).all()
    assert (tmp_path / "mended.xml").exists()


@pytest.mark.filterwarnings("ignore::flexspline.FormatWarning")
def test_gymnasium(monkeypatch, tmp_path):
    pytest.importorskip("gymnasium.envs.mujoco", exc_type=ImportError)
    before, after = distances("gymnasium_reacher", monkeypatch, tmp_path)
    assert (after < 0.2 * before).all()


def test_notebook(tmp_path):
    pytest.importorskip("nbconvert")
    pytest.importorskip("ipykernel")
    pytest.importorskip("mujoco")
    out = tmp_path / "executed.ipynb"
    convert = [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--output", str(out), str(FOLDER / "gap.ipynb")]
    done = subprocess.run(convert, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    cells = json.loads(out.read_text())["cells"]
    shown = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
    assert sum("image/png" in data for data in shown) == 2
    page = next("".join(data["text/html"]) for data in shown if "iframe" in "".join(data.get("text/html", "")))
    assert "What remains" in page
