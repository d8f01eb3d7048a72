#include "libs/base/options_file.h"

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

namespace mapmend {
namespace {

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  std::vector<OptionLine> Read() {
    std::error_code ignored;
    std::ifstream file(path_);
    if (!file || std::filesystem::is_directory(path_, ignored)) throw OptionError(path_ + ": cannot be read");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    try {
      const YAML::Node root = YAML::Load(text);
      if (!root.IsNull() && !root.IsMap()) Fail(root, "expected options, such as 'tracker.min_inliers: 30'");
      if (root.IsMap()) AddMap("", root);
    } catch (const YAML::Exception& e) {
      throw OptionError(path_ + ":" + std::to_string(e.mark.line + 1) + ": " + e.msg);
    }
    return lines_;
  }

 private:
  [[noreturn]] void Fail(const YAML::Node& node, const std::string& what) const {
    throw OptionError(path_ + ":" + std::to_string(node.Mark().line + 1) + ": " + what);
  }

  std::string Scalar(const std::string& name, const YAML::Node& node) const {
    if (!node.IsScalar()) Fail(node, name + ": expected values in one list");
    return node.Scalar();
  }

  void AddMap(const std::string& prefix, const YAML::Node& map) {
    for (const auto& entry : map) {
      if (!entry.first.IsScalar()) Fail(entry.first, "expected the name of an option");
      Add(prefix + entry.first.Scalar(), entry.first, entry.second);
    }
  }

  void Add(const std::string& name, const YAML::Node& key, const YAML::Node& value) {
    if (!names_.insert(name).second) Fail(key, name + ": is there twice");
    if (value.IsMap()) return AddMap(name + ".", value);
    OptionLine line{name, "", value.IsNull(), key.Mark().line + 1};
    if (value.IsScalar()) line.text = value.Scalar();
    if (value.IsSequence()) {
      for (const auto& element : value) line.text += (line.text.empty() ? "" : ", ") + Scalar(name, element);
    }
    lines_.push_back(line);
  }

  std::string path_;
  std::vector<OptionLine> lines_;
  std::set<std::string> names_;
};

}  // namespace

std::vector<OptionLine> ReadOptionsFile(const std::string& path) { return Reader(path).Read(); }

std::string PlaceOf(const std::string& path, const OptionLine& line) {
  return path + ":" + std::to_string(line.line) + ": ";
}

}  // namespace mapmend
