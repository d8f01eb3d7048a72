#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace mapmend {

// Sections of report.html, from summary.json; empty if it says nothing about them. Throw nlohmann::json::exception.

// Where each part of the map lies on the earth, and how well that is known.
std::string WorldSection(const nlohmann::json& summary);
// What to fly again.
std::string GapSection(const nlohmann::json& summary, const std::string& gaps_svg);

}  // namespace mapmend
