"""The README's start and the page about Python run as they are printed."""

import re
from pathlib import Path

import pytest
from conftest import EXAMPLES

ROOT = EXAMPLES.parent


@pytest.mark.filterwarnings("ignore::flexspline.FormatWarning")
@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_blocks_run(page, monkeypatch, tmp_path):
    pytest.importorskip("mujoco")
    pytest.importorskip("matplotlib")
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), flags=re.MULTILINE | re.DOTALL)
    assert blocks
    # they are run in examples/python; what they write goes elsewhere
    folder = tmp_path / "examples" / "python"
    folder.mkdir(parents=True)
    for name in ("python/arm.xml", "python/mujoco_arm.py", "bench.toml"):
        (folder.parent / name).write_text((EXAMPLES / name).read_text())
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    names = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    assert Path("gap.png").exists() and Path("mended.xml").exists()
