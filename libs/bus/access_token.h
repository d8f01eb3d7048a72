#pragma once

#include <string>
#include <string_view>

// The secret that lets a process of another host act on a hub: it publishes it before anything else.
namespace mapmend {

inline constexpr char kTokenChannel[] = "MAPMEND_TOKEN";      // the hub never passes it on
inline constexpr char kTokenEnvironment[] = "MAPMEND_TOKEN";  // where a process finds the token that it has to show

// The token in the file, without white space around it. Throws std::runtime_error with one line if it cannot be read or
// is shorter than 16 characters.
std::string ReadToken(const std::string& path);

// The same; a file that does not exist is made first, with 32 random hexadecimal digits, readable by its owner only.
// made tells whether it was. Two processes that make it at the same time end with the same token.
std::string ReadOrMakeToken(const std::string& path, bool* made);

// Takes equally long wherever the texts differ, so that no token can be found out letter by letter.
bool TokensAreEqual(std::string_view a, std::string_view b);

}  // namespace mapmend
