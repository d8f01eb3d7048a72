#include "libs/capture/video_reader.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/dict.h>
#include <libavutil/parseutils.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <tuple>
#include <vector>

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

std::string AvError(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

double ToDouble(AVRational number) { return number.den > 0 && number.num > 0 ? av_q2d(number) : 0; }

bool IsNamed(const AVInputFormat* format, const char* name) { return std::strstr(format->name, name) != nullptr; }

// Entries of the container's own list of a track's frames; 0 if it has none. hidden: of them, those that an edit list
// cuts away.
int CountListed(AVStream* stream, int* hidden) {
  const int count = avformat_index_get_entries_count(stream);
  for (int i = 0; i < count; ++i) {
    const AVIndexEntry* entry = avformat_index_get_entry(stream, i);
    if (entry != nullptr && (entry->flags & AVINDEX_DISCARD_FRAME) != 0) ++*hidden;
  }
  return count;
}

// More frames before a larger picture. Covers that say so come last.
bool IsBetterTrack(const AVStream* a, const AVStream* b) {
  const auto rank = [](const AVStream* s) {
    const bool is_cover = (s->disposition & AV_DISPOSITION_ATTACHED_PIC) != 0;
    const int64_t area = static_cast<int64_t>(s->codecpar->width) * s->codecpar->height;
    return std::tuple(!is_cover, s->nb_frames, area);
  };
  return rank(a) > rank(b);
}

}  // namespace

class VideoReader::Impl {
 public:
  Impl(const std::string& name, const std::string& url, double timeout_s, const std::atomic<bool>* stop)
      : name_(name), timeout_s_(timeout_s), stop_(stop) {
    try {
      Open(url);
    } catch (...) {
      Close();
      throw;
    }
  }
  ~Impl() { Close(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  const VideoInfo& Info() const { return info_; }

  bool Grab() {
    StartWait();
    constexpr int kMaxFailures = 1000;  // in a row: what decoders hold back is far less
    int num_failures = 0;
    while (true) {
      const int received = avcodec_receive_frame(decoder_, frame_);
      if (received == 0) {
        if (first_pts_ == AV_NOPTS_VALUE) first_pts_ = frame_->best_effort_timestamp;
        return true;
      }
      if (received == AVERROR_EOF || (received == AVERROR(EAGAIN) && draining_)) return false;
      if (received != AVERROR(EAGAIN)) {  // one picture could not be decoded; those behind it may
        ++num_damaged_;
        if (++num_failures > kMaxFailures) return false;
        if (draining_) continue;
      }
      Feed();
    }
  }

  cv::Mat Pixels() {
    const auto format = static_cast<AVPixelFormat>(frame_->format);
    // Rows longer than the picture, and one more: the scaler writes whole vectors, beyond the last pixel of a row.
    constexpr int kVector = 64;
    cv::Mat padded(frame_->height + 1, (frame_->width / kVector + 2) * kVector, CV_8UC3);
    const cv::Mat pixels = padded(cv::Rect(0, 0, frame_->width, frame_->height));
    scaler_ = sws_getCachedContext(scaler_, frame_->width, frame_->height, format, frame_->width, frame_->height,
                                   AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr, nullptr, nullptr);
    if (scaler_ == nullptr) return {};
    uint8_t* const planes[] = {pixels.data};
    const int strides[] = {static_cast<int>(pixels.step[0])};
    sws_scale(scaler_, frame_->data, frame_->linesize, 0, frame_->height, planes, strides);
    return pixels;
  }

  std::optional<int64_t> Utime() const {
    if (!info_.has_times || frame_->best_effort_timestamp == AV_NOPTS_VALUE) return std::nullopt;
    return av_rescale_q(frame_->best_effort_timestamp - first_pts_, stream_->time_base, AVRational{1, 1000000});
  }

  std::string Cut() const {
    if (!draining_) return {};
    if (read_error_ != AVERROR_EOF) return "the file is truncated or damaged";
    return EndsEarly() ? "the file is truncated or damaged" : "";
  }

  int NumDamaged() const { return num_damaged_; }
  bool IsDamaged() const { return frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0; }

 private:
  static int Interrupt(void* self) {
    const auto* impl = static_cast<const Impl*>(self);
    if (impl->stop_ != nullptr && *impl->stop_) return 1;
    return impl->timeout_s_ > 0 && Clock::now() > impl->deadline_ ? 1 : 0;
  }

  void StartWait() {
    if (timeout_s_ > 0)
      deadline_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_s_));
  }

  void Open(const std::string& url) {
    av_log_set_level(AV_LOG_QUIET);
    StartWait();
    container_ = avformat_alloc_context();
    if (container_ == nullptr) throw std::bad_alloc();
    container_->interrupt_callback = {&Impl::Interrupt, this};
    AVDictionary* options = nullptr;
    if (stop_ != nullptr) av_dict_set(&options, "rtsp_transport", "tcp", 0);
    const int opened = avformat_open_input(&container_, url.c_str(), nullptr, &options);
    av_dict_free(&options);
    const bool is_file = stop_ == nullptr;
    if (opened < 0) {
      if (!is_file) throw std::runtime_error("source " + name_ + " cannot be opened: " + AvError(opened));
      throw std::runtime_error("input " + name_ +
                               " cannot be opened as a video: unknown format, or cut short (an mp4 has its index at "
                               "its end)");
    }
    avformat_find_stream_info(container_, nullptr);  // what it cannot find is missed below
    ChooseTrack(is_file ? "input " : "source ");
    OpenDecoder();
    Describe();
  }

  void ChooseTrack(const std::string& what) {
    std::vector<AVStream*> tracks;
    for (unsigned i = 0; i < container_->nb_streams; ++i) {
      AVStream* stream = container_->streams[i];
      if (stream->codecpar->codec_type == AVMEDIA_TYPE_VIDEO && stream->codecpar->width > 0) tracks.push_back(stream);
    }
    if (tracks.empty()) throw std::runtime_error(what + name_ + ": the video holds no frame that can be decoded");
    // Without counts in the container libavformat knows best: it has looked at the first seconds.
    const bool counted = std::any_of(tracks.begin(), tracks.end(), [](const AVStream* s) { return s->nb_frames > 0; });
    const int best = av_find_best_stream(container_, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
    stream_ = !counted && best >= 0 ? container_->streams[best]
                                    : *std::min_element(tracks.begin(), tracks.end(), IsBetterTrack);
    for (unsigned i = 0; i < container_->nb_streams; ++i) {
      if (container_->streams[i] != stream_) container_->streams[i]->discard = AVDISCARD_ALL;
    }
    if (tracks.size() > 1) {
      const auto number = std::find(tracks.begin(), tracks.end(), stream_) - tracks.begin() + 1;
      info_.track_note = std::to_string(tracks.size()) + " video tracks; number " + std::to_string(number) + " of " +
                         std::to_string(stream_->codecpar->width) + " x " + std::to_string(stream_->codecpar->height) +
                         " pixels is taken";
    }
  }

  void OpenDecoder() {
    const AVCodec* codec = avcodec_find_decoder(stream_->codecpar->codec_id);
    if (codec == nullptr) {
      throw std::runtime_error("input " + name_ + ": no decoder for " + avcodec_get_name(stream_->codecpar->codec_id));
    }
    decoder_ = avcodec_alloc_context3(codec);
    frame_ = av_frame_alloc();
    packet_ = av_packet_alloc();
    if (decoder_ == nullptr || frame_ == nullptr || packet_ == nullptr) throw std::bad_alloc();
    avcodec_parameters_to_context(decoder_, stream_->codecpar);
    decoder_->pkt_timebase = stream_->time_base;
    decoder_->thread_count = stop_ != nullptr ? 1 : 0;  // a camera's frame must not wait for those behind it
    if (const int opened = avcodec_open2(decoder_, codec, nullptr); opened < 0) {
      throw std::runtime_error("input " + name_ + " cannot be decoded: " + AvError(opened));
    }
  }

  void Describe() {
    info_.width = stream_->codecpar->width;
    info_.height = stream_->codecpar->height;
    info_.fps = ToDouble(stream_->avg_frame_rate);
    if (info_.fps == 0) info_.fps = ToDouble(av_guess_frame_rate(container_, stream_, nullptr));
    info_.has_times = (container_->iformat->flags & AVFMT_NOTIMESTAMPS) == 0 && !IsBareStream();
    int hidden = 0;
    const int listed = CountListed(stream_, &hidden);
    if (stream_->nb_frames > 0 && IsNamed(container_->iformat, "mp4")) {
      expected_packets_ = listed;
      info_.num_frames = listed - hidden;
    } else if (stream_->nb_frames > 0 && IsNamed(container_->iformat, "avi")) {
      expected_slots_ = stream_->nb_frames;
      if (listed == stream_->nb_frames) info_.num_frames = listed;
    }
    if (const AVDictionaryEntry* entry = av_dict_get(stream_->metadata, "DURATION", nullptr, 0)) {
      int64_t duration_us = 0;
      if (av_parse_time(&duration_us, entry->value, 1) == 0)
        expected_end_ = av_rescale_q(duration_us, AVRational{1, 1000000}, stream_->time_base);
    }
    info_.frames_hint = info_.num_frames > 0 ? info_.num_frames : GuessNumFrames();
    if (const AVDictionaryEntry* entry = av_dict_get(container_->metadata, "creation_time", nullptr, 0)) {
      int64_t utime = 0;
      if (av_parse_time(&utime, entry->value, 0) == 0 && utime > 0) info_.creation_utime = utime;
    }
  }

  // H.264 and its like without a container: libavformat makes times up from a rate that nobody gave.
  bool IsBareStream() const {
    return std::strcmp(container_->iformat->name, avcodec_get_name(stream_->codecpar->codec_id)) == 0 ||
           IsNamed(container_->iformat, "mjpeg") || IsNamed(container_->iformat, "_pipe") ||
           IsNamed(container_->iformat, "m4v");
  }

  // Does the container announce more of this track than was there? Sound that goes on for longer says nothing.
  bool EndsEarly() const {
    if (num_packets_ < expected_packets_ || last_is_torn_) return true;
    // The steps between frames differ; the longest one is still within the track's length.
    if (expected_slots_ > 0 && last_dts_ != AV_NOPTS_VALUE && last_dts_ + longest_step_ < expected_slots_) return true;
    constexpr int kSlackSteps = 3;
    return expected_end_ > 0 && last_dts_ != AV_NOPTS_VALUE &&
           last_dts_ + kSlackSteps * longest_step_ + av_rescale_q(1, AVRational{1, 2}, stream_->time_base) <
               expected_end_;
  }

  int GuessNumFrames() const {
    double guess = static_cast<double>(stream_->nb_frames);
    if (guess <= 0 && stream_->duration > 0)
      guess = static_cast<double>(stream_->duration) * av_q2d(stream_->time_base) * info_.fps;
    if (guess <= 0 && container_->duration > 0)
      guess = static_cast<double>(container_->duration) / AV_TIME_BASE * info_.fps;
    return std::isfinite(guess) && guess > 0 && guess < 1e9 ? static_cast<int>(std::lround(guess)) : 0;
  }

  // One more packet for the decoder, or the news that there is none.
  void Feed() {
    while (true) {
      const int read = av_read_frame(container_, packet_);
      if (read < 0) {
        read_error_ = read;
        draining_ = true;
        avcodec_send_packet(decoder_, nullptr);
        return;
      }
      const bool mine = packet_->stream_index == stream_->index;
      if (mine) {
        ++num_packets_;
        last_is_torn_ = (packet_->flags & AV_PKT_FLAG_CORRUPT) != 0;
        if (packet_->dts != AV_NOPTS_VALUE) {
          if (last_dts_ != AV_NOPTS_VALUE) longest_step_ = std::max(longest_step_, packet_->dts - last_dts_);
          last_dts_ = packet_->dts;
        }
        if (avcodec_send_packet(decoder_, packet_) < 0) ++num_damaged_;
      }
      av_packet_unref(packet_);
      if (mine) return;
    }
  }

  void Close() {
    sws_freeContext(scaler_);
    av_packet_free(&packet_);
    av_frame_free(&frame_);
    avcodec_free_context(&decoder_);
    avformat_close_input(&container_);
  }

  std::string name_;
  double timeout_s_;
  const std::atomic<bool>* stop_;
  Clock::time_point deadline_;
  VideoInfo info_;
  AVFormatContext* container_ = nullptr;
  AVStream* stream_ = nullptr;
  AVCodecContext* decoder_ = nullptr;
  AVFrame* frame_ = nullptr;
  AVPacket* packet_ = nullptr;
  SwsContext* scaler_ = nullptr;
  int64_t first_pts_ = AV_NOPTS_VALUE, last_dts_ = AV_NOPTS_VALUE, longest_step_ = 1, num_packets_ = 0;
  int64_t expected_packets_ = 0;  // mp4: entries of its list
  int64_t expected_slots_ = 0;    // avi: its length in units of the time base
  int64_t expected_end_ = 0;      // matroska: length of the track, time base
  int read_error_ = 0, num_damaged_ = 0;
  bool draining_ = false, last_is_torn_ = false;
};

// "file:" keeps libavformat from taking a colon in the name for the end of a protocol's.
VideoReader::VideoReader(const std::string& path) : impl_(std::make_unique<Impl>(path, "file:" + path, 0, nullptr)) {}
VideoReader::VideoReader(const std::string& url, double timeout_s, const std::atomic<bool>* stop)
    : impl_(std::make_unique<Impl>(url, url, timeout_s, stop)) {}
VideoReader::~VideoReader() = default;
const VideoInfo& VideoReader::Info() const { return impl_->Info(); }
bool VideoReader::Grab() { return impl_->Grab(); }
cv::Mat VideoReader::Pixels() { return impl_->Pixels(); }
std::optional<int64_t> VideoReader::Utime() const { return impl_->Utime(); }
std::string VideoReader::Cut() const { return impl_->Cut(); }
bool VideoReader::IsDamaged() const { return impl_->IsDamaged(); }
int VideoReader::NumDamaged() const { return impl_->NumDamaged(); }

}  // namespace mapmend
