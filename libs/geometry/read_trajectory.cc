#include "libs/geometry/read_trajectory.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <stdexcept>

#include "libs/base/text_table.h"
#include "libs/geometry/times_file.h"

namespace mapmend {
namespace {

constexpr int64_t kLatestTime = 100000000000000000;  // the year 5138
constexpr size_t kNone = static_cast<size_t>(-1);

// Which column holds what.
struct Layout {
  std::string format;
  size_t time = 0;
  std::array<size_t, 3> position = {1, 2, 3};
  std::array<size_t, 4> quaternion = {4, 5, 6, 7};  // x y z w; kNone: there is none
  bool is_matrix = false;                           // 12 columns, no time
  size_t num_columns = 0;                           // that a line needs at least
  bool exactly = true;
};

// "p_RS_R_x [m]" to "prsrx": letters and digits only, in small letters, without the unit.
std::string PlainName(const std::string& name) {
  std::string plain;
  for (const unsigned char c : name.substr(0, name.find_first_of("[("))) {
    if (std::isalnum(c)) plain += static_cast<char>(std::tolower(c));
  }
  return plain;
}

// Columns by the names of the head; nothing if time and position are not all there.
std::optional<Layout> LayoutOfNames(const TextTable& table) {
  const size_t count = table.rows[0].fields.size();
  std::vector<std::string> names;
  for (size_t i = 0; i < count; ++i) names.push_back(PlainName(table.HeadOf(i)));
  const auto find = [&](const std::vector<std::string>& wanted) {
    for (const std::string& name : wanted) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found != names.end()) return static_cast<size_t>(found - names.begin());
    }
    return kNone;
  };
  Layout layout;
  layout.time = find({"timestamp", "time", "t", "timestamps", "times", "sec", "seconds", "timens"});
  const char* axes[] = {"x", "y", "z", "w"};
  for (int i = 0; i < 3; ++i) {
    const std::string a = axes[i];
    layout.position[i] = find({"prsr" + a, "t" + a, "p" + a, "pos" + a, "position" + a, a});
  }
  for (int i = 0; i < 4; ++i)
    layout.quaternion[i] =
        find({std::string("qrs") + axes[i], std::string("q") + axes[i], std::string("orientation") + axes[i]});
  if (layout.time == kNone || std::count(layout.position.begin(), layout.position.end(), kNone) > 0)
    return std::nullopt;
  const auto missing = std::count(layout.quaternion.begin(), layout.quaternion.end(), kNone);
  if (missing > 0 && missing < 4) return std::nullopt;
  const Layout tum;
  const bool as_tum = layout.time == tum.time && layout.position == tum.position && layout.quaternion == tum.quaternion;
  const bool as_euroc = std::count(names.begin(), names.end(), "prsrx") > 0;
  layout.format = as_tum ? "TUM" : as_euroc ? "EuRoC csv" : "columns by their names";
  layout.num_columns = layout.time + 1;
  for (const size_t column : layout.position) layout.num_columns = std::max(layout.num_columns, column + 1);
  for (const size_t column : layout.quaternion) {
    if (column != kNone) layout.num_columns = std::max(layout.num_columns, column + 1);
  }
  layout.exactly = false;
  return layout;
}

std::optional<Layout> LayoutOf(const TextTable& table) {
  if (const auto named = LayoutOfNames(table)) return named;
  const size_t count = table.rows[0].fields.size();
  Layout layout;
  layout.num_columns = count;
  if (count == 8) {
    layout.format = "TUM";
  } else if (count == 4) {
    layout.format = "positions (t x y z)";
    layout.quaternion.fill(kNone);
  } else if (count == 12) {
    layout.format = "KITTI";
    layout.is_matrix = true;
  } else if (count >= 16) {
    layout.format = "EuRoC csv";
    layout.quaternion = {5, 6, 7, 4};
    layout.num_columns = 8;
    layout.exactly = false;
  } else {
    return std::nullopt;
  }
  return layout;
}

class TrajectoryReader {
 public:
  TrajectoryReader(const std::string& path, const TextTable& table, const std::vector<int64_t>& frame_times)
      : path_(path), table_(table), frame_times_(frame_times) {}

  TrajectoryFile Read() {
    const auto layout = LayoutOf(table_);
    if (!layout) {
      Fail(table_.rows[0],
           "expected 8 numbers (t tx ty tz qx qy qz qw), 4 (t x y z), 12 (KITTI) or EuRoC's csv, found " +
               std::to_string(table_.rows[0].fields.size()));
    }
    file_.format = layout->format;
    if (layout->is_matrix) {
      RequireFrameTimes();
    } else {
      std::vector<std::string> texts;
      for (const TextRow& row : table_.rows) {
        if (row.fields.size() > layout->time) texts.push_back(row.fields[layout->time]);
      }
      unit_ = GuessTimeUnit(texts, table_.HeadOf(layout->time));
    }
    size_t num_rotations = 0;
    for (size_t i = 0; i < table_.rows.size(); ++i) {
      StampedPose pose;
      bool has_rotation = true;
      if (!ReadRow(table_.rows[i], *layout, i, &pose, &has_rotation)) {
        ++file_.num_left_out;
        continue;
      }
      num_rotations += has_rotation;
      file_.poses.push_back(pose);
    }
    if (file_.poses.empty()) throw std::runtime_error(path_ + ": no pose that is a number");
    file_.has_rotations = num_rotations > 0;
    Describe(*layout);
    return std::move(file_);
  }

 private:
  [[noreturn]] void Fail(const TextRow& row, const std::string& problem) const {
    throw std::runtime_error(path_ + ":" + std::to_string(row.line) + ": " + problem);
  }

  void RequireFrameTimes() const {
    const std::string here = path_ + ": a matrix of 12 numbers a line (KITTI) has no times; ";
    if (frame_times_.empty()) throw std::runtime_error(here + "give those of the frames with --times");
    if (frame_times_.size() != table_.rows.size()) {
      throw std::runtime_error(here + "it has " + std::to_string(table_.rows.size()) + " poses for " +
                               std::to_string(frame_times_.size()) + " times of frames; it needs one for each");
    }
  }

  double Number(const TextRow& row, size_t column, bool* is_nan) const {
    double value = 0;
    const std::string& field = row.fields[column];
    if (!ParseNumber(field, &value) || std::isinf(value)) Fail(row, "bad number '" + field.substr(0, 40) + "'");
    *is_nan = *is_nan || std::isnan(value);
    return value;
  }

  // False if the line holds a number that is none.
  bool ReadRow(const TextRow& row, const Layout& layout, size_t index, StampedPose* pose, bool* has_rotation) const {
    if (row.fields.size() < layout.num_columns || (layout.exactly && row.fields.size() > layout.num_columns)) {
      Fail(row, "expected " + std::to_string(layout.num_columns) + " numbers as in the lines before (" + layout.format +
                    "), found " + std::to_string(row.fields.size()));
    }
    bool is_nan = false;
    if (layout.is_matrix) {
      Eigen::Matrix<double, 3, 4> m;
      for (size_t i = 0; i < 12; ++i)
        m(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4)) = Number(row, i, &is_nan);
      if (is_nan) return false;
      const Eigen::Matrix3d rotation = m.leftCols<3>();
      if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() > 0.05 || rotation.determinant() < 0)
        Fail(row, "the matrix is not a rotation");
      pose->utime = frame_times_[index];
      pose->world_from_camera = Rigid3(Eigen::Quaterniond(rotation), m.col(3));
      return true;
    }
    const std::string& time = row.fields[layout.time];
    double seconds = 0;
    if (ParseNumber(time, &seconds) && std::isnan(seconds)) return false;
    if (!ParseTime(time, unit_, &pose->utime)) Fail(row, "bad time '" + time.substr(0, 40) + "'");
    if (std::abs(pose->utime) > kLatestTime)
      Fail(row, "time '" + time.substr(0, 40) + "' is not in " + NameOf(unit_) + " as the others");
    std::array<double, 7> values = {0, 0, 0, 0, 0, 0, 1};
    for (size_t i = 0; i < 3; ++i) values[i] = Number(row, layout.position[i], &is_nan);
    *has_rotation = layout.quaternion[0] != kNone;
    if (*has_rotation) {
      for (size_t i = 0; i < 4; ++i) values[3 + i] = Number(row, layout.quaternion[i], &is_nan);
    }
    if (is_nan) return false;
    const double norm = Eigen::Map<const Eigen::Vector4d>(values.data() + 3).norm();
    if (norm == 0) {
      *has_rotation = false;
      values[6] = 1;
    } else if (std::abs(norm - 1.0) > 0.01) {
      Fail(row, "the quaternion's length is " + std::to_string(norm) + ", not 1");
    }
    pose->world_from_camera = RigidFromArray(values.data());
    return true;
  }

  void Describe(const Layout& layout) {
    std::string& note = file_.note;
    const auto add = [&](const std::string& text) { note += (note.empty() ? "" : ", ") + text; };
    if (layout.format != "TUM") add("read as " + layout.format);
    if (unit_ != TimeUnit::kSeconds) add(std::string("times in ") + NameOf(unit_));
    if (!file_.has_rotations && layout.quaternion[0] != kNone) add("positions without rotations");
    if (file_.num_left_out > 0)
      add(std::to_string(file_.num_left_out) + (file_.num_left_out == 1 ? " line that is" : " lines that are") +
          " not a number left out");
    if (!note.empty()) note = path_ + ": " + note;
  }

  const std::string& path_;
  const TextTable& table_;
  const std::vector<int64_t>& frame_times_;
  TimeUnit unit_ = TimeUnit::kSeconds;
  TrajectoryFile file_;
};

}  // namespace

TrajectoryFile ReadTrajectoryFile(const std::string& path, const std::vector<int64_t>& frame_times) {
  const TextTable table = ReadTextTable(path, "trajectory");
  if (table.rows.empty()) throw std::runtime_error(path + ": no poses (expected lines `t tx ty tz qx qy qz qw`)");
  return TrajectoryReader(path, table, frame_times).Read();
}

TrajectoryFile ReadGroundTruth(const std::string& path, const std::string& times_path, double time_offset_s) {
  std::vector<int64_t> frame_times;
  if (!times_path.empty()) frame_times = ReadFrameTimes(times_path).utimes;
  TrajectoryFile file = ReadTrajectoryFile(path, frame_times);
  const int64_t offset = std::llround(time_offset_s * 1e6);
  for (StampedPose& pose : file.poses) pose.utime += offset;
  return file;
}

Trajectory ReadTrajectory(const std::string& path) { return ReadTrajectoryFile(path).poses; }

}  // namespace mapmend
