#pragma once

#include <string>

#include "libs/bus/process.h"
#include "libs/merging/merger.h"

namespace mapmend {

struct MergerProcessOptions {
  ProcessOptions process;
  std::string vocabulary;  // path; empty: sessions' vocabularies are not checked
  MergerOptions merger;
};

// Runs the merger on the bus until a signal. Returns the exit code. Throws std::runtime_error with one line on trouble.
int RunMergerProcess(const MergerProcessOptions& options);

}  // namespace mapmend
