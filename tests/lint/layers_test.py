#!/usr/bin/env python3
"""Does layers.py see what it is there for?"""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import layers  # noqa: E402


class LayersTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.write("libs/CMakeLists.txt", "foreach(lib base geometry bus wire)\n")
        for folder, names in layers.MAY_INCLUDE_LCM.items():
            for name in names:
                self.write(f"{folder}/{name}", "#include <mapmend/image_t.hpp>\n")

    def tearDown(self):
        self.folder.cleanup()

    def write(self, path, text):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text)

    def problems_of(self, path, include):
        self.write(path, f"#include {include}\n")
        return layers.check(self.root)

    def test_what_is_allowed(self):
        for path, include in [("libs/geometry/a.cc", '"libs/base/b.h"'), ("libs/geometry/a.cc", '"libs/geometry/a.h"'),
                              ("libs/wire/a.cc", "<mapmend/ack_t.hpp>"), ("procs/merger/a.cc", '"libs/wire/b.h"'),
                              ("procs/frontend/live_images.cc", "<mapmend/ack_t.hpp>"), ("libs/base/a.h", "<vector>"),
                              ("procs/merger/a.cc", '"procs/merger/b.h"')]:
            self.assertEqual(self.problems_of(path, include), [], include)

    def test_a_library_above(self):
        self.assertEqual(len(self.problems_of("libs/base/a.h", '"libs/geometry/b.h"')), 1)

    def test_a_library_that_nobody_named(self):
        self.assertEqual(len(self.problems_of("libs/geometry/a.h", '"libs/mapping/b.h"')), 1)

    def test_another_process(self):
        self.assertEqual(len(self.problems_of("procs/merger/a.cc", '"procs/frontend/b.h"')), 1)

    def test_a_process_from_a_library(self):
        self.assertEqual(len(self.problems_of("libs/wire/a.cc", '"procs/frontend/b.h"')), 1)

    def test_a_message_in_a_core(self):
        self.assertEqual(len(self.problems_of("procs/merger/a.cc", "<mapmend/ack_t.hpp>")), 1)
        self.assertEqual(len(self.problems_of("libs/geometry/a.cc", '"mapmend/ack_t.hpp"')), 2)

    def test_an_adapter_that_needs_no_message_types_any_more(self):
        problems = self.problems_of("procs/frontend/live_images.cc", '"libs/wire/b.h"')
        self.assertEqual(len(problems), 1)
        self.assertIn("procs/frontend/live_images.cc", problems[0])

    def test_an_adapter_that_is_gone(self):
        (self.root / "procs/mapmend/publish_command.cc").unlink()
        self.assertEqual(len(layers.check(self.root)), 1)

    def test_an_adapter_is_one_by_its_folder(self):
        self.assertEqual(len(self.problems_of("procs/merger/live_images.cc", "<mapmend/ack_t.hpp>")), 1)

    def test_tests(self):
        self.assertEqual(len(self.problems_of("procs/merger/a.cc", '"tests/merger_fixture.h"')), 1)


if __name__ == "__main__":
    unittest.main()
