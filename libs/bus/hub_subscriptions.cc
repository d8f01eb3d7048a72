#include "libs/bus/hub_subscriptions.h"

#include <re2/re2.h>

#include <algorithm>

namespace mapmend {
namespace {

constexpr size_t kMaxPatterns = 256, kMaxPatternBytes = 16 << 10, kMaxExpressions = 32;  // of one client
constexpr int64_t kMaxExpressionMemory = 128 << 10;  // bytes; RE2 refuses what would need more

}  // namespace

std::shared_ptr<const re2::RE2> HubExpressions::Find(const std::string& text, size_t max_in_use, std::string* error) {
  const auto it = expressions_.find(text);
  if (it != expressions_.end()) {
    if (auto compiled = it->second.lock()) return compiled;
  }
  if (NumInUse() >= max_in_use) {
    *error = "there are too many regular expressions at once";
    return nullptr;
  }
  re2::RE2::Options options(re2::RE2::Latin1);  // names are bytes
  options.set_log_errors(false);
  options.set_never_capture(true);
  options.set_max_mem(kMaxExpressionMemory);
  auto compiled = std::make_shared<const re2::RE2>(text, options);
  if (!compiled->ok()) {
    *error = "it is no regular expression that can be used (" + compiled->error() + ")";
    return nullptr;
  }
  expressions_[text] = compiled;
  return compiled;
}

size_t HubExpressions::NumInUse() {
  std::erase_if(expressions_, [](const auto& entry) { return entry.second.expired(); });
  return expressions_.size();
}

std::string HubSubscriptions::Add(std::string_view pattern, size_t max_expressions_in_use,
                                  HubExpressions* expressions) {
  if (num_patterns_ >= kMaxPatterns) return "a client may have " + std::to_string(kMaxPatterns) + " subscriptions";
  if (num_bytes_ + pattern.size() > kMaxPatternBytes) return "its subscriptions are too long";
  if (pattern.find_first_of("\\^$.|?*+()[]{}") == std::string_view::npos) {
    ++names_[std::string(pattern)];
  } else {
    if (expressions_.size() >= kMaxExpressions)
      return "a client may have " + std::to_string(kMaxExpressions) + " regular expressions";
    std::string error;
    auto compiled = expressions->Find(std::string(pattern), max_expressions_in_use, &error);
    if (compiled == nullptr) return error;
    expressions_.push_back({std::string(pattern), std::move(compiled)});
  }
  ++num_patterns_;
  num_bytes_ += pattern.size();
  return "";
}

void HubSubscriptions::Remove(std::string_view pattern) {
  if (const auto name = names_.find(pattern); name != names_.end()) {
    if (--name->second == 0) names_.erase(name);
  } else {
    const auto it = std::find_if(expressions_.begin(), expressions_.end(),
                                 [&](const Expression& expression) { return expression.text == pattern; });
    if (it == expressions_.end()) return;
    expressions_.erase(it);
  }
  --num_patterns_;
  num_bytes_ -= pattern.size();
}

bool HubSubscriptions::Match(const std::string& channel) const {
  return names_.contains(channel) ||
         std::any_of(expressions_.begin(), expressions_.end(),
                     [&](const Expression& expression) { return re2::RE2::FullMatch(channel, *expression.compiled); });
}

}  // namespace mapmend
