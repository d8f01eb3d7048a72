#include "procs/submap_store/db_images.h"

#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include "libs/images/image_file.h"
#include "procs/submap_store/database.h"

namespace mapmend {
namespace {

constexpr size_t kPutAtOnce = 16 << 20;  // bytes in one transaction

struct StoredKeyframe {
  int frame = -1;
  bool is_culled = false;
};
using Keyframes = std::map<std::pair<std::string, KeyframeId>, StoredKeyframe>;

Keyframes ReadKeyframes(const std::string& path) {
  Keyframes keyframes;
  Database database(path, Database::Mode::kReadOnly);
  auto rows = database.Prepare(
      "SELECT uuid, keyframe, frame, removed_seq IS NOT NULL FROM keyframe JOIN session ON id = session");
  while (rows->executeStep()) {
    keyframes[{rows->getColumn(0).getString(), KeyframeId(rows->getColumn(1).getInt())}] = {
        rows->getColumn(2).getInt(), rows->getColumn(3).getInt() != 0};
  }
  return keyframes;
}

// Null if there are none.
std::unique_ptr<ImageFile> OpenImages(const std::string& database, ImageFile::Mode mode) {
  const std::string path = ImagePathFor(database);
  return std::filesystem::exists(path) ? std::make_unique<ImageFile>(path, mode) : nullptr;
}

}  // namespace

std::vector<std::string> CheckImages(const std::string& database) {
  std::vector<std::string> problems;
  try {
    const auto images = OpenImages(database, ImageFile::Mode::kReadOnly);
    if (!images) return problems;
    problems = images->Check();
    const Keyframes keyframes = ReadKeyframes(database);
    for (const ImageFile::Entry& entry : images->List()) {
      const auto keyframe = keyframes.find({entry.session, entry.keyframe});
      if (keyframe != keyframes.end() && keyframe->second.frame == entry.frame) continue;
      problems.push_back(images->Path() + ": session " + entry.session + ", image of keyframe " +
                         std::to_string(entry.keyframe.value) +
                         (keyframe == keyframes.end() ? ": the map has no such keyframe" : ": is of another frame"));
    }
  } catch (const std::runtime_error& e) {
    problems.emplace_back(e.what());
  }
  return problems;
}

ImageTotals CountImages(const std::string& database) {
  ImageTotals totals;
  const auto images = OpenImages(database, ImageFile::Mode::kReadOnly);
  for (const auto& [key, keyframe] : ReadKeyframes(database)) {
    if (keyframe.is_culled) continue;
    const auto entry = images ? images->Find(key.first, key.second) : std::nullopt;
    ++(entry ? totals.stored : totals.missing);
    if (entry) totals.bytes += entry->num_bytes;
  }
  return totals;
}

std::string DescribeImages(const std::string& database) {
  const ImageTotals totals = CountImages(database);
  char line[160];
  std::snprintf(line, sizeof(line), "images of %d of %d keyframes, %.1f MB", totals.stored,
                totals.stored + totals.missing, 1e-6 * static_cast<double>(totals.bytes));
  return line;
}

void CompactImages(const std::string& database) {
  const auto images = OpenImages(database, ImageFile::Mode::kReadWrite);
  if (!images) return;
  const auto before = std::filesystem::file_size(images->Path());
  const Keyframes keyframes = ReadKeyframes(database);
  for (const ImageFile::Entry& entry : images->List()) {
    const auto keyframe = keyframes.find({entry.session, entry.keyframe});
    const bool is_wanted =
        keyframe != keyframes.end() && !keyframe->second.is_culled && keyframe->second.frame == entry.frame;
    if (!is_wanted || !images->Get(entry.session, entry.keyframe)) images->Remove(entry.session, {entry.keyframe});
  }
  images->Compact();
  std::printf("%s: %llu bytes, were %llu\n", images->Path().c_str(),
              static_cast<unsigned long long>(std::filesystem::file_size(images->Path())),
              static_cast<unsigned long long>(before));
}

int MergeImages(const std::vector<std::string>& databases, const std::string& out) {
  int num_images = 0;
  std::unique_ptr<ImageFile> into;
  std::vector<KeyframeImage> batch;
  size_t batch_bytes = 0;
  const auto put = [&] {
    if (batch.empty()) return;
    if (!into) into = std::make_unique<ImageFile>(ImagePathFor(out), ImageFile::Mode::kReadWrite);
    into->Put(batch);
    num_images += static_cast<int>(batch.size());
    batch.clear();
    batch_bytes = 0;
  };
  for (const std::string& database : databases) {
    const auto images = OpenImages(database, ImageFile::Mode::kReadOnly);
    if (!images) continue;
    for (const ImageFile::Entry& entry : images->List()) {
      auto image = images->Get(entry.session, entry.keyframe);
      if (!image) {
        std::printf("%s: session %s, image of keyframe %d is damaged and left out\n", images->Path().c_str(),
                    entry.session.c_str(), entry.keyframe.value);
        continue;
      }
      batch_bytes += image->bytes.size();
      batch.push_back(std::move(*image));
      if (batch_bytes >= kPutAtOnce) put();
    }
  }
  put();
  return num_images;
}

}  // namespace mapmend
