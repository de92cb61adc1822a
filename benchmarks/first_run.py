"""How long the first flight takes after an installation: ``python benchmarks/first_run.py WHEEL``.

Unpacks a wheel with machine code (``hatch_build.py``) beside the packages that this Python has, and calls ``colift run`` with an empty cache: as it
is, once more with what the first call has left in the cache, and then without the machine code, where everything is compiled.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

SITE = "import sys; sys.argv[0] = 'colift'; from colift.cli import main; main()"


def seconds(library, cache, mission, out):
    """Wall time of ``colift run`` with the package in a folder and a cache."""
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", SITE, "run", mission, "--out", str(out)],
        env=os.environ | {"PYTHONPATH": str(library), "COLIFT_CACHE": str(cache)},
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--mission", default="paper-spiral")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        library, cache, out = (Path(folder) / name for name in ("library", "cache", "out"))
        with zipfile.ZipFile(asked.wheel) as packed:
            packed.extractall(library)
        size = sum(each.stat().st_size for each in (library / "colift/_compiled").rglob("*.nb?"))
        print(
            f"wheel {asked.wheel.stat().st_size / 1e6:.1f} MB, of which machine code unpacked {size / 1e6:.1f} MB"
        )
        for name in ("first run", "second run"):
            print(
                f"{name:25s} {seconds(library, cache, asked.mission, out / name):5.1f} s",
                flush=True,
            )
        shutil.rmtree(library / "colift/_compiled")
        shutil.rmtree(cache)
        for name in ("first run, compiling", "second run"):
            print(
                f"{name:25s} {seconds(library, cache, asked.mission, out / ('bare ' + name)):5.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
