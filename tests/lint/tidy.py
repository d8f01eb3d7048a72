#!/usr/bin/env python3
"""clang-tidy over the C++ files that differ from a commit (default: the one before the last), each warning an error.

    tidy.py BUILD_FOLDER [COMMIT]

Exit codes: 0, 1, 77 if clang-tidy or the history is not here. At most 20 files are looked at, so that it ends in minutes.
"""

import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MAX_FILES = 20


def main():
    build, commit = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "HEAD~1"
    program = shutil.which("clang-tidy")
    if not program:
        print("tidy: left out: there is no clang-tidy here (apt install clang-tidy)")
        return 77
    changed = subprocess.run(["git", "-C", str(ROOT), "diff", "--name-only", "--diff-filter=d", commit, "--", "libs/*.cc",
                              "procs/*.cc"], capture_output=True, text=True, check=False)
    if changed.returncode:
        print(f"tidy: left out: there is no {commit} here")
        return 77
    files = changed.stdout.split()
    if len(files) > MAX_FILES:
        print(f"tidy: {len(files)} files have changed; the first {MAX_FILES} are looked at")
    failures = 0
    for file in files[:MAX_FILES]:
        result = subprocess.run([program, "-p", build, "--quiet", "--warnings-as-errors=*", str(ROOT / file)],
                                capture_output=True, text=True, check=False)
        if result.returncode:
            failures += 1
            print(result.stdout[-3000:])
    print(f"tidy: {len(files[:MAX_FILES])} files, {failures} with complaints")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
