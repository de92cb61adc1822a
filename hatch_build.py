"""Puts machine code into a wheel: ``HATCH_BUILD_HOOKS_ENABLE=true pip wheel . --no-deps --wheel-dir dist``.

The wheel is for this platform and this version of Python; colift in it compiles nothing at its first use (:mod:`colift.kernel.prebuilt`).
Without the variable a wheel is pure Python, for all.
"""

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Precompiled(BuildHookInterface):
    """Compiles all kernels for a common processor, and includes them."""

    def initialize(self, version, build_data):
        source = Path(self.root) / "src"
        prebuilt = runpy.run_path(str(source / "colift" / "kernel" / "prebuilt.py"))
        common = prebuilt["processor"]()
        if self.target_name != "wheel" or version == "editable" or common is None:
            return
        folder = Path(self.directory) / "compiled"
        shutil.rmtree(folder, ignore_errors=True)
        name, features = common
        told = {
            "COLIFT_CACHE": str(folder), "NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features, "PYTHONPATH": str(source),
        }  # fmt: skip
        subprocess.run(
            [sys.executable, "-m", "colift", "compile"], env=os.environ | told, check=True
        )
        for turn in folder.rglob("*.turn"):
            turn.unlink()
        build_data["force_include"][str(folder)] = f"colift/{prebuilt['FOLDER'].name}"
        build_data["pure_python"], build_data["infer_tag"] = False, True
