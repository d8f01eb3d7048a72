#pragma once

#include <string>
#include <vector>

#include "libs/merging/merger.h"
#include "tests/synthetic_flight.h"

// What the tests of the merger share: a flight, retrieval, and somebody who writes down what the merger says.
namespace mapmend::testing {

// Retrieval by brute force over all records up to the cursors.
class BruteForceBow : public BowSource {
 public:
  explicit BruteForceBow(std::vector<Record> records) : records_(std::move(records)) {}

  std::vector<BowProposal> Query(const BowQuestion& question) override;
  int num_queries() const { return num_queries_; }

 private:
  std::vector<Record> records_;
  int num_queries_ = 0;
};

struct Recorder : MergerOutput {
  void OnConnection(const Connection& c) override { connections.push_back(c); }
  void OnTransforms(const MergedTransforms& t) override { transforms.push_back(t); }
  void OnRevision(const MergedTransforms& t, const std::vector<Connection>& c,
                  const std::vector<RefinedSubmap>& s) override {
    revision = t;
    final_connections = c;
    submaps = s;
  }
  void OnProgress(const std::string& what) override { progress.push_back(what); }

  std::vector<Connection> connections, final_connections;
  std::vector<MergedTransforms> transforms;
  MergedTransforms revision;
  std::vector<std::string> progress;
  std::vector<RefinedSubmap> submaps;
};

// A frame and scale for a submap, submap_from_world.
Similarity3 Frame(double scale, double angle);

// The terrain of most tests.
const std::vector<TerrainPoint>& Terrain();

SubmapView ViewOf(const Session& session, int submap);

// Three submaps: 0 and 1 cross at 90 degrees, 2 lies apart from 0 and crosses 1.
SyntheticFlight ThreeCrossingStrips();

// Root mean square distance of the refined keyframes from the truth after alignment, metres.
double MergedError(const Recorder& out, const std::vector<Rigid3>& world_from_keyframe);

// All that a revision says, as text.
std::string Digest(const Recorder& out);

}  // namespace mapmend::testing
