#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libs/stream/keyframe_images.h"

namespace mapmend {

// Images of keyframes in an SQLite file (docs/file_formats.md): the store's images.db, and a frontend's spool of what
// the store has not had yet. What is put is on the disk when Put returns. Thread-safe. Every function throws
// std::runtime_error with one line that names the file if it cannot be read or written.
class ImageFile {
 public:
  enum class Mode { kReadWrite, kReadOnly };
  // kReadWrite makes the file, if there is none, with the first image. Throws if it is none of ours, of a newer
  // version, or (kReadOnly) missing.
  ImageFile(const std::string& path, Mode mode);
  ~ImageFile();
  ImageFile(const ImageFile&) = delete;
  ImageFile& operator=(const ImageFile&) = delete;

  struct Entry {
    std::string session;
    KeyframeId keyframe;
    int frame = -1;
    int64_t num_bytes = 0;
  };
  // By session, then keyframe. From memory, as is Find.
  std::vector<Entry> List() const;
  std::optional<Entry> Find(const std::string& session, KeyframeId keyframe) const;
  // nullopt if it is not there, or its checksum does not fit.
  std::optional<KeyframeImage> Get(const std::string& session, KeyframeId keyframe) const;
  // In one transaction. An image of a keyframe takes the place of an earlier one.
  void Put(const std::vector<KeyframeImage>& images);
  void Remove(const std::string& session, const std::vector<KeyframeId>& keyframes);
  // Gives back what is not used.
  void Compact();
  // Reads everything; a line for each image that is damaged.
  std::vector<std::string> Check() const;
  // The file is no longer where it was opened: removed, or replaced.
  bool IsGone() const;
  const std::string& Path() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Where a database of maps has its images: images.db beside map.db, NAME.images.db beside any other NAME.db.
std::string ImagePathFor(const std::string& database);
// Where a frontend's spool is: beside its outbox.
std::string SpoolPathFor(const std::string& outbox);
// Removes such a file with what SQLite has left beside it.
void RemoveImageFile(const std::string& path);

}  // namespace mapmend
