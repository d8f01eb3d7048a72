#pragma once

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace mapmend {

// Runs the program ffmpeg with the given arguments, as in a shell. Throws std::runtime_error if it fails.
inline void Ffmpeg(const std::string& arguments) {
  const std::string command = "ffmpeg -v error -nostdin -y " + arguments;
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}

// Arguments of an input for ffmpeg: a moving test picture of 160 x 120 pixels, 30 frames a second.
inline std::string TestPicture(int num_frames) {
  return "-f lavfi -i testsrc2=s=160x120:r=30:d=" + std::to_string((num_frames - 0.5) / 30.0) + " ";
}

}  // namespace mapmend
