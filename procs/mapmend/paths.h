#pragma once

#include <filesystem>
#include <string>

// Where mapmend's own files lie. The source tree (build/bin, data/) and an installation (bin, libexec/mapmend,
// share/mapmend) are both found relative to the running program, so that neither needs a setting.
namespace mapmend {

// The folder of the running program.
std::filesystem::path ProgramFolder();

// Full path of one of mapmend's programs: beside this one, else in ../libexec/mapmend. Throws std::runtime_error naming
// it if absent.
std::string FindProgram(const std::string& name);

// A file of the data folder, e.g. "vocabulary/mapmend.voc": ../share/mapmend/ (installed, or made by
// the build) or ../../data/ (source tree). Empty if absent.
std::string FindData(const std::string& name);

// The vocabulary to use unless told otherwise; empty if absent.
inline std::string DefaultVocabulary() { return FindData("vocabulary/mapmend.voc"); }

}  // namespace mapmend
