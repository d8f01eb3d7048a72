# cmake -DHEADER=FILE -P guard_arrays.cmake: makes a header written by lcm-gen refuse array lengths that do not fit into the
# bytes that are left of the message, before it allocates them (see array_guard.h).
file(READ ${HEADER} text)
string(REGEX REPLACE "this->([A-Za-z0-9_]+)\\.resize\\(this->([A-Za-z0-9_]+)\\);"
       "if (!::mapmend::lcm_guard::Fits(this->\\1, this->\\2, maxlen - pos)) return -1;\n        this->\\1.resize(this->\\2);"
       text "${text}")
string(REPLACE "#include <lcm/lcm_coretypes.h>" "#include <lcm/lcm_coretypes.h>\n#include \"mapmend/array_guard.h\""
       text "${text}")
file(WRITE ${HEADER} "${text}")
