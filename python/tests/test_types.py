"""Annotations and stubs say what is there."""

import subprocess
import sys
from pathlib import Path

import pytest


def test_types_and_stubs(tmp_path):
    pytest.importorskip("mypy")
    package = Path(__file__).parents[1]
    check = [sys.executable, "-m", "mypy", "--config-file", str(package / "pyproject.toml"), str(package / "src/flexspline")]
    stubs = [sys.executable, "-m", "mypy.stubtest", "flexspline._native", "--ignore-disjoint-bases"]
    for command in (check, stubs):
        # from a folder where the sources do not hide the package
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
