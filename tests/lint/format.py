#!/usr/bin/env python3
"""Is every C++ file formatted as .clang-format says? Exit codes: 0, 1, 77 if clang-format 14 is not here."""

import pathlib
import re
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from files import tracked  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
VERSION = "14"  # Debian 12's; another one formats otherwise
FOLDERS = ("libs", "procs", "tools", "tests", "examples")


def find():
    for name in (f"clang-format-{VERSION}", "clang-format"):
        program = shutil.which(name)
        if not program:
            continue
        told = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
        if re.search(rf"version {VERSION}\.", told):
            return program
    return None


def main():
    program = find()
    if not program:
        print(f"format: left out: there is no clang-format {VERSION} here (apt install clang-format)")
        return 77
    files = [str(path) for path in tracked(ROOT, *(f"{top}/*.{suffix}" for top in FOLDERS for suffix in ("cc", "h")))]
    if not files:
        print("format: there are no files to look at")
        return 1
    result = subprocess.run([program, "--dry-run", "--Werror", *files], capture_output=True, text=True, check=False)
    print(result.stderr[-4000:] or f"format: {len(files)} files are as they should be")
    return 1 if result.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
