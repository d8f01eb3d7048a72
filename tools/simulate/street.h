#pragma once

#include <memory>

#include "tools/simulate/material.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// A street round a block: its middle line is the rectangle (0, 0) to (width, length) metres; 8 m of road, pavements,
// houses of two to five floors on both sides, parked cars, trees, lamp posts.
std::unique_ptr<Scene> BuildStreetScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                        int num_threads);

}  // namespace mapmend::simulate
