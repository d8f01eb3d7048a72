#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "libs/capture/clip.h"

// Logs of lcm-logger that hold a camera's images as an input: whoever checks, reads or plays one asks here.
namespace mapmend {

// The same inputs, but a folder that holds recordings and no image files stands as its recordings, in the order in
// which they were made. Throws std::runtime_error naming a folder that cannot be read.
std::vector<std::string> ExpandLogs(const std::vector<std::string>& inputs);

// Whether the inputs are logs, by their beginning or by the ending .lcmlog. Throws std::runtime_error if only some are.
bool AreLogs(const std::vector<std::string>& inputs);

// The images on one channel (image_t of mapmend or of bot_core) of one flight's logs, in any order of the files, as one
// clip. Times are those of the images, put in order as those of a camera on the bus (ImageOrder). What is damaged is
// passed over, and told at the end (Clip::Missing). The logs are read twice: first to know what they hold.
//   channel  empty: MAPMEND_IMAGE
// Throws std::runtime_error naming the file if it is no log, or the channels that it holds if this is none with images.
std::unique_ptr<Clip> OpenLogClip(const std::vector<std::string>& paths, const std::string& channel);

// For SourceOptions::open_other: OpenLogClip for logs, null for other inputs.
std::function<std::unique_ptr<Clip>(const std::vector<std::string>&)> LogOpener(const std::string& channel);

}  // namespace mapmend
