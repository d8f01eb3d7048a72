#!/usr/bin/env python3
"""clang-tidy over the C++ files that differ from a commit, each warning an error.

    tidy.py BUILD_FOLDER [COMMIT]

The commit is the argument, else the environment's MAPMEND_TIDY_BASE (origin/main before a change is sent), else the
one before the last. Exit codes: 0, 1, 77 if clang-tidy or the history is not here. At most 20 files are looked at, and
none is begun after six minutes, so that it ends soon; what is left out is told.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MAX_FILES = 20
MAX_SECONDS = 360


def git(root, *arguments):
    """What git says; None if it fails."""
    told = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False)
    return told.stdout.strip() if told.returncode == 0 else None


def base(root, argument, environment):
    """The commit to compare with; None if there is none."""
    if asked := argument or environment:
        return git(root, "rev-parse", "--verify", "--quiet", asked + "^{commit}")
    return git(root, "rev-parse", "--verify", "--quiet", "HEAD~1")


def changed(root, commit):
    """Sources that differ from the commit, what is not committed yet included."""
    told = git(root, "diff", "--name-only", "--diff-filter=d", commit, "--", "libs/*.cc", "procs/*.cc")
    return told.split() if told else []


def commands_by_file(build):
    """A folder with a compile_commands.json that has each file by itself, also where batches of them are compiled."""
    entries = json.loads((build / "compile_commands.json").read_text())
    single = []
    for entry in entries:
        batch = pathlib.Path(entry["file"])
        if not re.fullmatch(r"unity_\d+_cxx\.cxx", batch.name):
            single.append(entry)
            continue
        # What the batches need and clang does not know.
        command = entry["command"].replace(" -Wno-subobject-linkage", "")
        for file in re.findall(r'^#include "([^"]+)"', batch.read_text(), re.MULTILINE):
            single.append({**entry, "file": file, "command": command.replace(str(batch), file)})
    folder = build / "tidy"
    folder.mkdir(exist_ok=True)
    (folder / "compile_commands.json").write_text(json.dumps(single))
    return folder


def main():
    build = commands_by_file(pathlib.Path(sys.argv[1]))
    program = shutil.which("clang-tidy")
    if not program:
        print("tidy: left out: there is no clang-tidy here (apt install clang-tidy)")
        return 77
    commit = base(ROOT, sys.argv[2] if len(sys.argv) > 2 else "", os.environ.get("MAPMEND_TIDY_BASE", ""))
    if not commit:
        print("tidy: left out: there is no commit to compare with")
        return 77
    files = changed(ROOT, commit)
    failures = looked_at = 0
    until = time.monotonic() + MAX_SECONDS
    for file in files[:MAX_FILES]:
        if time.monotonic() > until:
            break
        looked_at += 1
        result = subprocess.run([program, "-p", str(build), "--quiet", "--warnings-as-errors=*", str(ROOT / file)],
                                capture_output=True, text=True, check=False)
        if result.returncode:
            failures += 1
            print(result.stdout[-3000:])
    print(f"tidy: looked at {looked_at} of {len(files)} files that differ from {commit[:8]}, {failures} with complaints")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
