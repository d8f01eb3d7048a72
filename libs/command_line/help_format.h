#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace mapmend {

// Help as CLI11 prints it, with the kinds of values in words: FILE, N (1 to 100000), X.
class HelpFormat : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
};

}  // namespace mapmend
