#!/usr/bin/env python3
"""Does every relative link of the Markdown files lead to something?

    links.py [ROOT]

Looks at [text](target), ![picture](target) and pages named in running text (docs/merging.md); a part behind # must be a
heading of the page. Links to other hosts are not followed. Prints each that leads nowhere, and exits with 1 if there is
any.
"""

import pathlib
import re
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from files import tracked  # noqa: E402

LINK = re.compile(r"\]\(([^()\s]+)\)")
PAGE = re.compile(r"(?<![\w/.(-])((?:docs|data)/[\w/.-]+\.md)\b")
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.M | re.S)


def anchors(page):
    """The names that headings get, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def leads_nowhere(page, target):
    path, _, anchor = target.partition("#")
    goal = page.parent / path if path else page
    return not goal.exists() or bool(anchor) and goal.suffix == ".md" and anchor not in anchors(goal)


def check(root):
    problems, links = [], 0
    for page in tracked(root, "*.md"):
        text = page.read_text()
        targets = [target for target in LINK.findall(CODE.sub("", text)) if not re.match(r"\w+:", target)]
        mentions = PAGE.findall(text)
        links += len(targets) + len(mentions)
        name = page.relative_to(root)
        problems += [f"{name}: {target} leads nowhere" for target in targets if leads_nowhere(page, target)]
        problems += [f"{name}: there is no {path}" for path in mentions if not (root / path).exists()]
    return problems, links


if __name__ == "__main__":
    found, number = check(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".").resolve())
    print("\n".join(found) if found else f"links: all {number} lead somewhere")
    sys.exit(1 if found or not number else 0)
