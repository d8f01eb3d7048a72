"""Which files the rules look at."""

import subprocess


def tracked(root, *patterns):
    """The files below root that match one of the patterns ("libs/*.cc"; * also stands for folders), sorted: in a
    checkout those that git knows or would add, so that build folders and leftovers do not count; elsewhere all."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard",
                             "--", *patterns], capture_output=True, text=True, check=False)
    if listed.returncode == 0 and (root / ".git").exists():
        paths = [root / name for name in listed.stdout.split("\0") if name]
    else:
        paths = [path for pattern in patterns for path in below(root, pattern)
                 if not any(part.startswith((".", "build")) for part in path.relative_to(root).parts[:1])]
    return sorted({path for path in paths if path.is_file()})


def below(root, pattern):
    folder, _, name = pattern.rpartition("/")
    return (root / folder).rglob(name)
