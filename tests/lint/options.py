#!/usr/bin/env python3
"""Do all structs of options describe themselves?

    options.py [ROOT]

A struct whose name ends in Options has a Visit that names each of its members under its own name (libs/base/options.h),
or says which it leaves out: "// Not visited: seed, path: why." Prints what is missing, and exits with 1 if anything is.
"""

import pathlib
import re
import sys

# What a command line says, or one part of a program tells another: files, addresses, flags, objects.
ARGUMENTS = {
    "libs/bus/process.h": {"ProcessOptions"},
    "libs/images/image_sender.h": {"ImageSenderOptions"},
    "procs/mapmend/backend.h": {"BackendOptions"},
    "procs/mapmend/calibrate_command.cc": {"CalibrateOptions"},
    "procs/mapmend/close_command.cc": {"CloseOptions"},
    "procs/mapmend/doctor_command.cc": {"DoctorOptions"},
    "procs/mapmend/edges_command.cc": {"EdgesOptions"},
    "procs/mapmend/eval_command.cc": {"EvalOptions"},
    "procs/mapmend/map_file.h": {"MapFileOptions"},
    "procs/mapmend/publish_command.cc": {"PublishOptions"},
    "procs/mapmend/replay_command.cc": {"ReplayOptions"},
    "procs/mapmend/run_options.h": {"RunOptions"},
    "procs/mapmend/station_command.cc": {"StationOptions"},
    "procs/mapmend/status_command.cc": {"StatusOptions"},
    "procs/mapmend/view_command.cc": {"ViewOptions"},
    "procs/merger/merger_process.h": {"MergerProcessOptions"},
    "procs/viewer_export/exporter.h": {"ExportOptions"},
    "procs/submap_store/image_store.h": {"ImageStoreOptions"},
    "procs/viewer_export/connection_picture.h": {"ConnectionPictureOptions"},
    "procs/viewer_export/live_overview.h": {"OverviewOptions"},
    "procs/viewer_export/live_page.h": {"PageOptions"},
    "procs/viewer_export/live_server.h": {"LiveServerOptions"},
    "procs/viewer_export/trajectory_picture.h": {"TrajectoryPictureOptions"},
    "procs/viewer_export/world_summary.h": {"WorldSummaryOptions"},
}
STRUCT = re.compile(r"^(?P<indent> *)struct (?P<name>\w*Options) \{\n(?P<body>.*?)^(?P=indent)\};", re.M | re.S)
MEMBER = re.compile(r"^ *(?!using |static |return |friend )[\w:]+(?:<[^;=]*>)? (?P<names>\w+(?: = [^;]*?)?(?:, \w+(?: = [^;]*?)?)*);", re.M)


def members(body):
    """Names of the data members."""
    code = re.sub(r"//[^\n]*", "", body[: body.find("template <typename Visitor>")] if "Visitor" in body else body)
    code = re.sub(r"\{[^{}]*\}", "0", re.sub(r"\([^()]*\)", "", code))  # what they are set to
    names = []
    for match in MEMBER.finditer(re.sub(r"=\s+", "= ", code)):
        names += [part.split("=")[0].strip() for part in match["names"].split(", ")]
    return names


def left_out(body):
    """Names after "Not visited:", up to the next colon."""
    comment = re.sub(r"\n *// ?", " ", body)
    return {name for match in re.finditer(r"Not visited: ([\w, ]+?)[:.]", comment) for name in re.split(r"[, ]+", match[1])}


def check(root):
    problems, num_structs = [], 0
    for top in ("libs", "procs"):
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            relative = str(path.relative_to(root))
            for struct in STRUCT.finditer(path.read_text()):
                if struct["name"] in ARGUMENTS.get(relative, ()):
                    continue
                num_structs += 1
                where, body = f"{relative}: {struct['name']}", struct["body"]
                if "void Visit(Visitor& v)" not in body:
                    problems.append(f"{where} has no Visit")
                    continue
                for name in members(body):
                    visits = re.search(rf'v\("{name}", {name}\b', body) or re.search(rf"\b{name}\.Visit\(v\)|&{name}\}}", body)
                    if not visits and name not in left_out(body):
                        problems.append(f"{where} does not visit {name}")
    return problems, num_structs


if __name__ == "__main__":
    found, count = check(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print("\n".join(found) if found else f"options: {count} structs describe themselves")
    sys.exit(1 if found or count == 0 else 0)
