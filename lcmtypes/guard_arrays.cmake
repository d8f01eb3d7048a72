# cmake -DHEADER=FILE -P guard_arrays.cmake: makes a header written by lcm-gen refuse array lengths that do not fit into the
# bytes that are left of the message, before it allocates them (see array_guard.h), and string lengths below 1, which it would
# turn into a read of up to 2 GB (it checks only the upper bound, then subtracts 1 for the terminator).
file(READ ${HEADER} text)
string(REGEX REPLACE "this->([A-Za-z0-9_]+)\\.resize\\(this->([A-Za-z0-9_]+)\\);"
       "if (!::mapmend::lcm_guard::Fits(this->\\1, this->\\2, maxlen - pos)) return -1;\n        this->\\1.resize(this->\\2);"
       text "${text}")
string(REGEX REPLACE "if\\((__[A-Za-z0-9_]+) > maxlen - pos\\) return -1;"
       "if (\\1 < 1 || \\1 > maxlen - pos) return -1;" text "${text}")
string(REPLACE "#include <lcm/lcm_coretypes.h>" "#include <lcm/lcm_coretypes.h>\n#include \"mapmend/array_guard.h\""
       text "${text}")
file(WRITE ${HEADER} "${text}")
