"""maturin as build backend, with the command `flexspline` in the wheel beside the extension.

maturin packs an extension or a program, not both. A run starts the command again for each of its processes, so it must be a program
of its own and no entry point of Python: it is built first and laid where maturin takes a wheel's data from.
"""

import atexit
import json
import os
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import *  # noqa: F403: the hooks that are not changed

PACKAGE = Path(__file__).resolve().parent.parent
ROOT = PACKAGE.parent
DATA = PACKAGE / "use-pip-wheel-instead-of-maturin-build"
SCRIPTS = DATA / "scripts"
# maturin asks for it before anything is built; without the backend there is none, so that no wheel lacks the command
SCRIPTS.mkdir(parents=True, exist_ok=True)
atexit.register(shutil.rmtree, DATA, ignore_errors=True)


def _build_command():
    cargo = os.environ.get("CARGO", "cargo")
    # both packages, so that what they share is compiled once, as maturin then finds it
    packages = ["--package", "flexspline", "--package", "flexspline-python"]
    subprocess.run([cargo, "build", "--release", *packages, "--bin", "flexspline"], check=True, cwd=ROOT)
    metadata = [cargo, "metadata", "--no-deps", "--format-version", "1"]
    told = subprocess.run(metadata, check=True, cwd=ROOT, stdout=subprocess.PIPE).stdout
    program = Path(json.loads(told)["target_directory"]) / "release" / "flexspline"
    shutil.copy2(program, SCRIPTS)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _build_command()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _build_command()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)
