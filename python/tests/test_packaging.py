"""How the package is built."""

import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1]


def test_maturin_alone_makes_no_wheel_without_the_command():
    maturin = shutil.which("maturin", path=sysconfig.get_path("scripts"))
    if maturin is None:
        pytest.skip("no maturin in this environment")
    hint = "use-pip-wheel-instead-of-maturin-build"
    assert not (PACKAGE / hint).exists(), "left by a build that was killed: remove it"
    build = subprocess.run([maturin, "build"], cwd=PACKAGE, stderr=subprocess.PIPE, text=True)
    assert build.returncode != 0 and hint in build.stderr
