#!/usr/bin/env python3
"""Checks who includes whom.

    layers.py [ROOT]

A library includes itself and libraries that stand before it in libs/CMakeLists.txt; a process includes libraries and
itself, never another process; what lcm-gen makes is included where messages are made and read. Prints each include that
breaks a rule, and exits with 1 if there is any.
"""

import pathlib
import re
import sys

# Beside libs/bus, libs/wire and libs/image_messages: adapters, which turn messages into what the cores work with.
# Of the cores these still do; none may be added.
MAY_INCLUDE_LCM = {
    "procs/frontend": {"live_images.cc"},
    "procs/mapmend": {"publish_command.cc"},
}
LCM_LIBRARIES = {"bus", "wire", "image_messages"}
INCLUDE = re.compile(r'^\s*#\s*include\s*["<]((?:libs|procs|tools|tests)/[^">]+|(?:mapmend|bot_core)/[^">]+)[">]', re.M)


def library_order(root):
    text = (root / "libs/CMakeLists.txt").read_text()
    return re.search(r"foreach\(lib ([^)]*)\)", text).group(1).split()


def problem(path, included, order):
    """What is wrong with one include; empty if nothing. path: parts of the including file below the root."""
    top, part = path[0], path[1]
    to = included.split("/")
    if to[0] in ("mapmend", "bot_core"):
        allowed = top == "libs" and part in LCM_LIBRARIES or path[-1] in MAY_INCLUDE_LCM.get(f"{top}/{part}", ())
        return "" if allowed else "message types belong into libs/wire and adapters"
    if top == "libs":
        if to[0] != "libs":
            return "a library includes libraries only"
        if part not in order or to[1] not in order:
            return f"libs/CMakeLists.txt does not name {part if part not in order else to[1]}"
        return "" if order.index(to[1]) <= order.index(part) else f"{to[1]} stands above {part}"
    if to[0] == "tests":
        return "nobody but tests includes tests"
    own = to[:2] == [top, part]
    return "" if to[0] == "libs" or own else "a process includes libraries and itself only"


def check(root):
    order = library_order(root)
    problems = []
    for top in ("libs", "procs", "tools"):
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".cc", ".h", ".inc"):
                continue
            relative = path.relative_to(root)
            for match in INCLUDE.finditer(path.read_text()):
                if what := problem(relative.parts, match.group(1), order):
                    problems.append(f"{relative}: includes {match.group(1)}: {what}")
    return problems


if __name__ == "__main__":
    found = check(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print("\n".join(found) if found else "layers: as they should be")
    sys.exit(1 if found else 0)
