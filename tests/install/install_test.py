#!/usr/bin/env python3
"""Does an installed mapmend work, and can others build on it? (docs/library.md)

    install_test.py BUILD_FOLDER [CXX]

Installs into BUILD_FOLDER/installed, builds examples/ against that tree alone, runs them and looks at what they print,
and lets the installed programs find each other and their data.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FLIGHT = ROOT / "data/flights/sheffield_cross"
CONNECTIONS = "A B 3 50 10\nB C 1 10 5\nA C 4 60 20\nD E 2 30 10\n"
# C = F + 0.1 M + 0.1 theta^2: 18, 4.5, 50, 15; B - C closes the triangle and is its weakest.
FOREST = "5 submaps, 4 connections, 2 maps\nA - C, C = 50\nA - B, C = 18\nD - E, C = 15\n"


def run(*command, given=None, expect=0):
    done = subprocess.run([str(word) for word in command], input=given, capture_output=True, text=True, check=False)
    if done.returncode != expect:
        sys.exit(f"{command[0]}: exit code {done.returncode}, not {expect}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout + done.stderr


def expect(what, is_so):
    print(("as expected: " if is_so else "NOT AS EXPECTED: ") + what.strip(), flush=True)
    if not is_so:
        sys.exit(1)


def scaled(trajectory, scale):
    """A TUM file with the positions scaled."""
    lines = []
    for line in trajectory.read_text().splitlines():
        words = line.split()
        if words and not line.startswith("#"):
            words[1:4] = [repr(scale * float(word)) for word in words[1:4]]
            lines.append(" ".join(words))
    return "\n".join(lines) + "\n"


def try_examples(build, installed, compiler):
    folder = build / "installed_examples"
    run("cmake", "-G", "Ninja", "-S", installed / "share/doc/mapmend/examples", "-B", folder, f"-DCMAKE_PREFIX_PATH={installed}",
        *([f"-DCMAKE_CXX_COMPILER={compiler}"] if compiler else []))
    commands = (folder / "compile_commands.json").read_text()
    expect("the examples do not see the source tree", f"{ROOT}/libs" not in commands and f"-I{ROOT} " not in commands)
    run("cmake", "--build", folder)
    told = run(folder / "connection_graph", given=CONNECTIONS)
    expect(told, told == FOREST)
    halved = folder / "halved.tum"
    truth = FLIGHT / "groundtruth.tum"
    halved.write_text(scaled(truth, 0.5))
    told = run(folder / "align_trajectory", halved, truth)
    number = sum(1 for line in halved.read_text().splitlines() if line)
    expect(told, told == f"{number} of {number} poses, scale 2.000, RMSE 0.000 m\n")
    told = run(folder / "align_trajectory", folder / "gone.tum", truth, expect=1)
    expect(told, told.startswith("align_trajectory: ") and "gone.tum" in told)
    told = run(folder / "listen", "nonsense://x", expect=1)
    expect(told, told.startswith("listen: ") and told.count("\n") == 1)


def try_programs(installed):
    mapmend = installed / "bin/mapmend"
    findings = json.loads(subprocess.run([str(mapmend), "doctor", "--json"], capture_output=True, text=True,
                                         check=False).stdout)  # its exit code tells of this machine as well
    texts = {finding["what"]: finding["text"] for finding in findings if finding["level"] == "ok"}
    expect("programs: " + texts["programs"], str(installed) in texts["programs"])
    expect("vocabulary: " + texts["vocabulary"],
           texts["vocabulary"].startswith(str(installed / "share/mapmend/vocabulary/mapmend.voc")))
    told = run(mapmend, "db", "--help")  # a program of libexec
    expect("mapmend starts its other programs", "Usage: mapmend db" in told)
    wanted = ["mapmend.1", "mapmend-run.1", "mapmend-edges.1"]
    found = [path.name for path in (installed / "share/man/man1").glob("*.1.gz")]
    expect("man pages", all(name + ".gz" in found for name in wanted))
    expect("the flight is there", (installed / "share/mapmend/flights/sheffield_cross/video.mp4").exists())


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    installed = build / "installed"
    shutil.rmtree(installed, ignore_errors=True)
    os.environ["CMAKE_EXPORT_COMPILE_COMMANDS"] = "ON"
    run("cmake", "--install", build, "--prefix", installed)
    try_programs(installed)
    try_examples(build, installed, sys.argv[2] if len(sys.argv) > 2 else "")


if __name__ == "__main__":
    main()
