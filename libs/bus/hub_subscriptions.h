#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace re2 {
class RE2;
}

namespace mapmend {

// Regular expressions, compiled once for all clients that use the same. What strangers can make the hub hold and
// compute is bounded: an expression takes a bounded amount of memory, there is a bounded number of them, and a match
// takes time linear in the length of the channel's name (RE2), whatever the expression.
class HubExpressions {
 public:
  // Null with the reason in error: it does not compile, is too large, or there are max_in_use already.
  std::shared_ptr<const re2::RE2> Find(const std::string& text, size_t max_in_use, std::string* error);
  size_t NumInUse();

 private:
  std::map<std::string, std::weak_ptr<const re2::RE2>> expressions_;
};

// What one client has subscribed to. As in LCM, an expression has to match the whole name; equal subscriptions count,
// and each has to be taken back.
class HubSubscriptions {
 public:
  // Empty, or why the client asks for too much or for something that is no expression.
  std::string Add(std::string_view pattern, size_t max_expressions_in_use, HubExpressions* expressions);
  void Remove(std::string_view pattern);
  bool Match(const std::string& channel) const;

 private:
  struct Expression {
    std::string text;
    std::shared_ptr<const re2::RE2> compiled;
  };
  std::map<std::string, int, std::less<>> names_;  // how often each was subscribed to
  std::vector<Expression> expressions_;
  size_t num_patterns_ = 0, num_bytes_ = 0;
};

}  // namespace mapmend
