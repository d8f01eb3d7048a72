#!/usr/bin/env python3
"""Checks who includes whom.

    layers.py [ROOT]

A library includes itself and libraries that stand before it in libs/CMakeLists.txt; a process includes libraries and
itself, never another process; what lcm-gen makes is included where messages are made and read, and nowhere else. Prints
what breaks a rule, and exits with 1 if there is anything.
"""

import pathlib
import re
import sys

# Message types are known to libs/bus, libs/wire and libs/image_messages, and to the adapters listed here. An adapter is a
# file of a process that itself subscribes to a channel or publishes on one, and whose messages have no plain type: images,
# whose pixels are not to be copied once more. Everybody else works with plain types, which libs/wire encodes and decodes.
# An entry that is not needed any more is reported, so that the list can only shrink.
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
    adapters = {f"{folder}/{name}" for folder, names in MAY_INCLUDE_LCM.items() for name in names}
    for top in ("libs", "procs", "tools"):
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".cc", ".h", ".inc"):
                continue
            relative = path.relative_to(root)
            for match in INCLUDE.finditer(path.read_text()):
                if match.group(1).startswith(("mapmend/", "bot_core/")):
                    adapters.discard(str(relative))
                if what := problem(relative.parts, match.group(1), order):
                    problems.append(f"{relative}: includes {match.group(1)}: {what}")
    problems += [f"{path}: MAY_INCLUDE_LCM names it, but it includes no message types" for path in sorted(adapters)]
    return problems


if __name__ == "__main__":
    found = check(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print("\n".join(found) if found else "layers: as they should be")
    sys.exit(1 if found else 0)
