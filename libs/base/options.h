#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "libs/base/range.h"

// Options that describe themselves. A struct of options says once what its members are called, what they may be and in
// which unit they are (its header needs libs/base/range.h only):
//
//   struct KeyframePolicyOptions {
//     double max_angle_deg = 3;  // Median angle between the rays to the points; above it, a new keyframe.
//     PnpOptions pnp;            // A struct of the same kind: its members are called pnp.confidence and so on.
//
//     template <typename Visitor>
//     void Visit(Visitor& v) {
//       v("max_angle_deg", max_angle_deg, Range(0.1, 45), "degrees");
//       v("pnp", pnp);
//     }
//     // Only where members can contradict each other: empty, or one line that says how.
//     std::string Conflict() const;
//   };
//
// Checking, reading, printing and keeping them come from that. Members may be bool, int, int64_t, uint64_t, double,
// std::string, std::vector of int or double, and std::optional<uint64_t>; what is not to be set from outside (a token,
// what the program finds out by itself) is not visited.
namespace mapmend {

// One member of such a struct.
struct Option {
  using Member = std::variant<bool*, int*, int64_t*, uint64_t*, double*, std::string*, std::vector<int>*,
                              std::vector<double>*, std::optional<uint64_t>*>;

  std::string name;            // dotted, from the outermost struct: "tracker.pnp.confidence"
  Member member;               // of the struct itself
  std::optional<Range> range;  // of numbers; for a vector, of each of its elements
  std::string unit;            // empty: a number of things, or a ratio

  // The value as Set takes it: "30", "0.5", "inf", "true", "none", "16, 8, 5".
  std::string Text() const;
  // Reads such a text. Returns an empty string, or what is wrong with it; then the member is as it was.
  std::string Set(const std::string& text) const;
  // Empty, or what is wrong with the value: "must lie in 0 to 1".
  std::string Check() const;
};

// A name or a value that does not fit, in one line that names it.
struct OptionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The options of a struct and of those within it, in the order of their visits. The struct must outlive the list.
class OptionList {
 public:
  template <typename Struct>
  static OptionList Of(Struct& options) {
    OptionList list;
    list.Add(options);
    return list;
  }

  const std::vector<Option>& options() const { return options_; }
  // nullptr if there is none of that name.
  const Option* Find(const std::string& name) const;
  bool IsGroup(const std::string& name) const;
  // The first problem in one line, "tracker.min_spread = 2: must lie in 0 to 1"; empty if there is none. First each
  // option for itself, then what does not go together.
  std::string Check() const;
  // Throws OptionError if there is no such option (naming the nearest ones), or the text is no value that it may have.
  // Names in its line begin with the prefix, e.g. "frontend.", as whoever set the option knows it.
  void Set(const std::string& name, const std::string& text, const std::string& prefix = "") const;

  // What a struct's Visit calls.
  template <typename Number>
  void operator()(const char* name, Number& member, const Range& range, const char* unit = "") {
    options_.push_back({prefix_ + name, &member, range, unit});
  }
  void operator()(const char* name, bool& member) { options_.push_back({prefix_ + name, &member, {}, ""}); }
  void operator()(const char* name, uint64_t& seed) { options_.push_back({prefix_ + name, &seed, {}, ""}); }
  void operator()(const char* name, std::optional<uint64_t>& seed) {
    options_.push_back({prefix_ + name, &seed, {}, ""});
  }
  void operator()(const char* name, std::string& member) { options_.push_back({prefix_ + name, &member, {}, ""}); }
  template <typename Struct>
  void operator()(const char* name, Struct& nested) {
    static_assert(std::is_class_v<Struct>, "a number needs a Range");
    const std::string outer = std::exchange(prefix_, prefix_ + name + ".");
    Add(nested);
    prefix_ = outer;
  }

 private:
  struct Group {
    std::string prefix;  // "" or "tracker."
    std::function<std::string()> conflict;
  };

  template <typename Struct>
  void Add(Struct& options) {
    options.Visit(*this);
    if constexpr (requires { options.Conflict(); }) {
      groups_.push_back({prefix_, [&options] { return options.Conflict(); }});
    }
  }

  std::string prefix_;
  std::vector<Option> options_;
  std::vector<Group> groups_;
};

// See OptionList::Check.
template <typename Struct>
std::string CheckOptions(const Struct& options) {
  return OptionList::Of(const_cast<Struct&>(options)).Check();  // is only read
}

// A JSON object of dotted names. Numbers without bound are the text "inf"; what is not given is null.
std::string ToJson(const OptionList& options);
// The same of those that differ from their defaults, given as the list of a struct as it is made.
std::string ChangesToJson(const OptionList& options, const OptionList& defaults);
// YAML as ReadOptionsFile takes it, under the name of a section unless that is empty; range, unit and, where it
// differs, the default are told as comments.
std::string ToYaml(const OptionList& options, const OptionList& defaults, const std::string& section);
// A table for the docs: name, default, range, unit.
std::string ToMarkdown(const OptionList& defaults, const std::string& section);

}  // namespace mapmend
