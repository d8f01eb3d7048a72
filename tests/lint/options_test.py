#!/usr/bin/env python3
"""Does options.py see what it is there for?"""

import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import options  # noqa: E402

STRUCT = """struct XOptions {
  int first = 3;  // not; this = 4
  double second = 0.5, third = 2;
  std::vector<int> fourth = {1, 2};
  BOptions nested;
  uint64_t seed = 1;

  // Not visited: seed: that of the program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("first", first, Range(0, 1));
    v("second", second, Range(0, 1));
    v("third", third, Range(0, 1));
    v("fourth", fourth, Range(0, 1));
    v("nested", nested);
  }
};
"""


class OptionsTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        (self.root / "libs").mkdir()
        (self.root / "procs").mkdir()

    def tearDown(self):
        self.folder.cleanup()

    def problems(self, text):
        (self.root / "libs/x.h").write_text(text)
        found, count = options.check(self.root)
        self.assertEqual(count, 1)
        return found

    def test_a_whole_struct_is_good(self):
        self.assertEqual(options.members(STRUCT), ["first", "second", "third", "fourth", "nested", "seed"])
        self.assertEqual(self.problems(STRUCT), [])

    def test_each_member_that_is_not_visited_is_told(self):
        for name in ("first", "second", "third", "fourth", "nested"):
            without = "".join(line + "\n" for line in STRUCT.splitlines() if not line.startswith(f'    v("{name}"'))
            self.assertEqual(self.problems(without), [f"libs/x.h: XOptions does not visit {name}"])

    def test_a_visit_under_another_name_is_none(self):
        found = self.problems(STRUCT.replace('v("second", second', 'v("second", first'))
        self.assertEqual(found, ["libs/x.h: XOptions does not visit second"])

    def test_what_is_left_out_needs_a_reason(self):
        found = self.problems(STRUCT.replace("  // Not visited: seed: that of the program.\n", ""))
        self.assertEqual(found, ["libs/x.h: XOptions does not visit seed"])

    def test_a_struct_without_visit_is_told(self):
        self.assertEqual(self.problems("struct XOptions {\n  int a = 1;\n};\n"), ["libs/x.h: XOptions has no Visit"])


if __name__ == "__main__":
    unittest.main()
