#pragma once

#include <memory>

#include "tools/simulate/material.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// One room of width x length metres, lower left corner at the origin, 2.8 m high: desks, monitors, shelves, papers,
// posters.
std::unique_ptr<Scene> BuildOfficeScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                        int num_threads);

// A corridor 2.4 m wide that runs round a rectangle of width x length metres (outer walls), lower left corner at the
// origin: doors, notice boards, posters, radiators, lamps. Its middle line is 1.2 m inside the outer walls.
std::unique_ptr<Scene> BuildCorridorScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                          int num_threads);

}  // namespace mapmend::simulate
