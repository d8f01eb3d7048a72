#include "libs/image_messages/image_log.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "libs/bus/channels.h"
#include "libs/bus/recording_file.h"
#include "libs/capture/image_list.h"
#include "libs/capture/image_order.h"
#include "libs/image_messages/image_message.h"
#include "libs/wire/codec.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

bool IsLogFile(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  return fs::path(path).extension() == ".lcmlog" || RecordingFile::IsLog(path);
}

bool IsFolderOfLogs(const std::string& folder) {
  std::error_code error;
  bool has_log = false;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (HasImageName(entry->path().string())) return false;
    has_log = has_log || (entry->is_regular_file(error) && RecordingFile::IsLog(entry->path().string()));
  }
  return has_log;
}

std::string Count(int64_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

// What a channel holds, for the message that the wanted one is not there.
struct Channel {
  int64_t num_messages = 0;
  bool has_images = false;
};

std::string DescribeChannels(const std::map<std::string, Channel>& channels) {
  constexpr size_t kNamed = 8;
  std::string text;
  size_t named = 0;
  for (const bool with_images : {true, false}) {
    for (const auto& [name, channel] : channels) {
      if (channel.has_images != with_images || named++ >= kNamed) continue;
      text += (text.empty() ? "" : ", ") + name + " (" + Count(channel.num_messages, "message") +
              (channel.has_images ? ", images)" : ")");
    }
  }
  return named > kNamed ? text + " and " + std::to_string(named - kNamed) + " more" : text;
}

class LogClip : public Clip {
 public:
  LogClip(const std::vector<std::string>& paths, const std::string& channel)
      : channel_(channel.empty() ? channels::kImage : channel) {
    std::vector<std::vector<Image>> images;
    for (const std::string& path : paths) {
      files_.push_back(std::make_unique<RecordingFile>(path));
      images.push_back(ReadIndex(static_cast<int>(files_.size()) - 1));
    }
    if (std::all_of(images.begin(), images.end(), [](const auto& part) { return part.empty(); })) Refuse();
    std::erase_if(images, [](const auto& part) { return part.empty(); });
    std::stable_sort(images.begin(), images.end(),
                     [](const auto& a, const auto& b) { return a.front().utime < b.front().utime; });
    PutInOrder(images);
    Describe();
  }

  bool Grab() override { return ++index_ < static_cast<int>(images_.size()); }
  DecodedImage Decode() override {
    const Image& place = images_[static_cast<size_t>(index_)];
    LoggedEvent event;
    image_t message{};
    if (!files_[static_cast<size_t>(place.file)]->ReadAt(place.offset, &event) ||
        !DecodeImageMessage(event.data.data(), static_cast<int>(event.data.size()), &message))
      return {nullptr, "is no longer in the log"};
    const auto [width, height] = UsualSize();
    if (message.width != width || message.height != height) {
      return {nullptr, "has " + std::to_string(message.width) + " x " + std::to_string(message.height) +
                           " pixels, the flight " + std::to_string(width) + " x " + std::to_string(height)};
    }
    if (const std::string problem = ImageProblem(message, width, height); !problem.empty())
      return {nullptr, "cannot be used: " + problem};
    return DecodeImage(message);
  }
  std::optional<int64_t> Utime() const override { return images_[static_cast<size_t>(index_)].utime; }
  std::string FrameName() const override {
    const Image& image = images_[static_cast<size_t>(index_)];
    return fs::path(files_[static_cast<size_t>(image.file)]->Path()).filename().string() + ", image " +
           std::to_string(index_);
  }
  std::string Missing() const override { return missing_; }
  std::pair<int, int> UsualSize() const override { return usual_size_; }

 private:
  struct Image {
    int file = 0;
    int64_t offset = 0, utime = 0, logged_utime = 0;
    int frame = 0;
  };

  std::vector<Image> ReadIndex(int file) {
    RecordingFile& log = *files_[static_cast<size_t>(file)];
    std::vector<Image> images;
    LoggedEvent event;
    while (log.Next(&event)) {
      Channel& channel = channels_[event.channel];
      ++channel.num_messages;
      const bool is_wanted = event.channel == channel_;
      if (!is_wanted && channel.num_messages > 1) continue;  // the first one shows what a channel is for
      image_t message{};
      const bool is_image = DecodeImageMessage(event.data.data(), static_cast<int>(event.data.size()), &message);
      channel.has_images = channel.has_images || is_image;
      if (!is_wanted) continue;
      if (!is_image) {
        ++num_no_images_;
      } else if (!IsEndOfStream(message)) {
        images.push_back({file, event.offset, message.utime, event.utime, message.frame});
        const std::pair size(message.width, message.height);
        if (const int votes = ++sizes_[size]; size.first > 0 && size.second > 0 && votes > sizes_[usual_size_])
          usual_size_ = size;
      }
    }
    return images;
  }

  [[noreturn]] void Refuse() const {
    const std::string log = "log " + files_.front()->Path() + (files_.size() > 1 ? " and others" : "");
    if (const auto it = channels_.find(channel_); it != channels_.end()) {
      throw std::runtime_error(log + ": none of the " + Count(it->second.num_messages, "message") + " on channel " +
                               channel_ + " is an image (image_t of mapmend or of bot_core)");
    }
    const bool has_images =
        std::any_of(channels_.begin(), channels_.end(), [](const auto& item) { return item.second.has_images; });
    const bool has_stream = std::any_of(channels_.begin(), channels_.end(), [](const auto& item) {
      return std::any_of(std::begin(kRecordChannels), std::end(kRecordChannels),
                         [&](const char* record) { return item.first.ends_with(record); });
    });
    if (has_stream && !has_images) {
      throw std::runtime_error(log + " is a recording of a mapped flight, without its images: `mapmend replay " +
                               files_.front()->Path() + "` makes its map");
    }
    throw std::runtime_error(log + " has no images on channel " + channel_ + "; it holds " +
                             DescribeChannels(channels_) +
                             (has_images ? ": name the camera's with --image-channel" : ""));
  }

  // As the frontend does with images on the bus; images_ gets those that are good, with times that grow.
  void PutInOrder(const std::vector<std::vector<Image>>& parts) {
    constexpr size_t kTold = 3;
    ImageOrder order;
    std::vector<Image> all;
    std::vector<std::string> events;
    for (const auto& part : parts) {
      for (const Image& image : part) {
        all.push_back(image);
        const ImageOrder::Decision decision = order.Add(image.utime, image.frame, image.logged_utime);
        for (const ImageOrder::Good& good : decision.good) {
          images_.push_back(all[static_cast<size_t>(good.id)]);
          images_.back().utime = good.utime;
        }
        if (!decision.event.empty()) events.push_back(decision.event);
      }
    }
    num_strays_ = static_cast<int64_t>(all.size() - images_.size());
    for (size_t i = 0; i < std::min(kTold, events.size()); ++i)
      facts_.notes.push_back("channel " + channel_ + ": " + events[i]);
    if (events.size() > kTold)
      facts_.notes.push_back("channel " + channel_ + ": the like " +
                             Count(static_cast<int64_t>(events.size() - kTold), "more time"));
  }

  void Describe() {
    const int count = static_cast<int>(images_.size());
    const double seconds = static_cast<double>(images_.back().utime - images_.front().utime) * 1e-6;
    facts_.name = files_.front()->Path();
    facts_.num_frames = facts_.frames_hint = count;
    if (count > 1 && seconds > 0) facts_.fps = (count - 1) / seconds;
    facts_.has_times = facts_.times_are_utc = true;
    facts_.times_note = "times from the images on channel " + channel_;
    const auto add = [this](const std::string& what) { missing_ += (missing_.empty() ? "" : "; ") + what; };
    for (const auto& file : files_) {
      const auto& damages = file->Damages();
      int64_t num_bytes = 0;
      for (const auto& damage : damages) num_bytes += damage.num_bytes;
      const std::string log = "log " + file->Path();
      if (!damages.empty()) {
        add(log + " is damaged at " + Count(static_cast<int64_t>(damages.size()), "place") + " (" +
            Count(num_bytes, "byte") + ", the first at byte " + std::to_string(damages.front().offset) + ")");
      }
      if (file->HasTornEnd()) add(log + " breaks off in the middle of a message");
    }
    if (num_no_images_ > 0)
      add(Count(num_no_images_, "message") + " on channel " + channel_ + (num_no_images_ == 1 ? " is" : " are") +
          " no image");
    if (num_strays_ > 0)
      add(Count(num_strays_, "image") + " with a time or number that does not follow those around it");
  }

  std::string channel_;
  std::vector<std::unique_ptr<RecordingFile>> files_;
  std::map<std::string, Channel> channels_;
  std::map<std::pair<int, int>, int> sizes_;
  std::pair<int, int> usual_size_ = {0, 0};
  std::vector<Image> images_;
  int64_t num_no_images_ = 0, num_strays_ = 0;
  std::string missing_;
  int index_ = -1;
};

}  // namespace

std::vector<std::string> ExpandLogs(const std::vector<std::string>& inputs) {
  std::vector<std::string> expanded;
  for (const std::string& input : inputs) {
    std::error_code error;
    if (!fs::is_directory(input, error) || !IsFolderOfLogs(input)) {
      expanded.push_back(input);
      continue;
    }
    const std::vector<std::string> logs = FindLogs({input});
    expanded.insert(expanded.end(), logs.begin(), logs.end());
  }
  return expanded;
}

bool AreLogs(const std::vector<std::string>& inputs) {
  const auto count = std::count_if(inputs.begin(), inputs.end(), IsLogFile);
  if (count == 0) return false;
  if (static_cast<size_t>(count) == inputs.size()) return true;
  const auto log = std::find_if(inputs.begin(), inputs.end(), IsLogFile);
  throw std::runtime_error("input " + *log + ": logs of lcm-logger and other inputs do not go together");
}

std::unique_ptr<Clip> OpenLogClip(const std::vector<std::string>& paths, const std::string& channel) {
  return std::make_unique<LogClip>(paths, channel);
}

std::function<std::unique_ptr<Clip>(const std::vector<std::string>&)> LogOpener(const std::string& channel) {
  return [channel](const std::vector<std::string>& inputs) {
    return AreLogs(inputs) ? OpenLogClip(inputs, channel) : nullptr;
  };
}

}  // namespace mapmend
