#!/usr/bin/env python3
"""Do links.py, tidy.py and what lists the files see what they are there for?"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import files  # noqa: E402
import links  # noqa: E402
import tidy  # noqa: E402


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name).resolve()

    def tearDown(self):
        self.folder.cleanup()

    def write(self, path, text="text\n"):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text)

    def git(self, *arguments):
        subprocess.run(["git", "-C", self.root, "-c", "user.name=n", "-c", "user.email=e", "-c", "init.defaultBranch=main",
                        *arguments], capture_output=True, check=True)

    def commit(self, path, text="text\n"):
        self.write(path, text)
        self.git("add", path)
        self.git("commit", "-m", path)


class LinksTest(Folder):
    def problems_of(self, text):
        self.write("docs/here.md", "# This page\n" + text)
        self.write("docs/images/a.png")
        self.write("docs/there.md", "# A *page*: of 2\n")
        return links.check(self.root)[0]

    def test_what_leads_somewhere(self):
        self.assertEqual(self.problems_of("[a](there.md) ![b](images/a.png) [c](https://nowhere.example/x.md) docs/there.md\n"
                                          "[d](there.md#a-page-of-2) [e](#this-page) `[f](gone.md)` [g](../docs)"), [])

    def test_what_leads_nowhere(self):
        for text in ["[a](gone.md)", "![b](images/gone.png)", "[c](there.md#gone)", "see docs/gone.md", "[d](#gone)"]:
            self.assertEqual(len(self.problems_of(text)), 1, text)


class FilesTest(Folder):
    def test_a_checkout(self):
        self.git("init")
        self.commit(".gitignore", "/build/\n")
        self.commit("libs/a/b.cc")
        self.write("libs/new.cc")
        self.write("build/libs/c.cc")
        self.write("libs/a/b.h")
        found = [str(path.relative_to(self.root)) for path in files.tracked(self.root, "libs/*.cc", "build/*.cc")]
        self.assertEqual(found, ["libs/a/b.cc", "libs/new.cc"])

    def test_a_plain_folder(self):
        for path in ["libs/a/b.cc", "libs/c.h", "build/libs/d.cc"]:
            self.write(path)
        found = [str(path.relative_to(self.root)) for path in files.tracked(self.root, "libs/*.cc", "*.cc")]
        self.assertEqual(found, ["libs/a/b.cc"])


class TidyTest(Folder):
    def setUp(self):
        super().setUp()
        self.git("init")
        for name in ("a", "b", "c"):
            self.commit(f"libs/{name}.cc")

    def files_of(self, argument="", environment=""):
        return tidy.changed(self.root, tidy.base(self.root, argument, environment))

    def test_the_last_commit_unless_told_otherwise(self):
        self.assertEqual(self.files_of(), ["libs/c.cc"])
        self.assertEqual(self.files_of("HEAD~2"), ["libs/b.cc", "libs/c.cc"])
        self.assertEqual(self.files_of("", "HEAD~2"), ["libs/b.cc", "libs/c.cc"])
        self.assertIsNone(tidy.base(self.root, "gone", ""))


if __name__ == "__main__":
    unittest.main()
