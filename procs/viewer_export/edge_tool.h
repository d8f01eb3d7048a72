#pragma once

#include <string>

#include "libs/stream/ids.h"

namespace mapmend {

class Bus;

// Draws the connection of two submaps of the map that a store on the bus holds into a PNG file. Prints what is known of
// the connection. Throws std::runtime_error with one line if the pair was not compared, there is nothing to show, or
// the store does not answer.
void ShowEdge(Bus* bus, const SubmapKey& a, const SubmapKey& b, const std::string& path);

// "SESSION:NUMBER". Throws std::runtime_error if it is not one.
SubmapKey ParseSubmapKey(const std::string& text);

}  // namespace mapmend
