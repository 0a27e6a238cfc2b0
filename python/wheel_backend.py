"""Builds the wheel with maturin, and adds the shared library for FMUs.

The wheel installs the library in lib/freeplay of the environment, where the command in bin looks for it. maturin packs the executable, and the other
files of the environment from `freeplay.data/data`.
"""

import json
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import (
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

HERE = Path(__file__).resolve().parent
DATA = HERE / "freeplay.data"


def built_library():
    """Path of the library from the build of the command, as cargo reports it."""
    command = ["cargo", "build", "--release", "--manifest-path", str(HERE / "../cli/Cargo.toml"), "--bin", "freeplay"]
    told = subprocess.run([*command, "--message-format", "json-render-diagnostics"], stdout=subprocess.PIPE, check=True, text=True).stdout
    for message in map(json.loads, told.splitlines()):
        if message.get("target", {}).get("name") == "freeplay_fmi":
            for name in message.get("filenames", []):
                if name.endswith(".so"):
                    return Path(name)
    raise RuntimeError("cargo reports no library freeplay_fmi: check that fmi/Cargo.toml has the crate type cdylib")


def with_library(build, *arguments):
    """Calls `build` while the library is in the folder that maturin packs."""
    library = DATA / "data" / "lib" / "freeplay" / "libfreeplay_fmi.so"
    library.parent.mkdir(parents=True, exist_ok=True)
    try:
        shutil.copyfile(built_library(), library)
        return build(*arguments)
    finally:
        shutil.rmtree(DATA)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds a wheel (hook of PEP 517)."""
    return with_library(maturin.build_wheel, wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds an editable wheel (hook of PEP 660)."""
    return with_library(maturin.build_editable, wheel_directory, config_settings, metadata_directory)
