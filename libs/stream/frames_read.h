#pragma once

#include "libs/stream/records.h"

namespace mapmend {

// How many frames of its input a session that was cut off has read: those up to last_frame that its settings do not
// leave out (--skip-frames, --every, --start, a session that goes on with another one's flight). Frames that were left
// out because they were damaged are counted, for nobody is left who knows of them.
//   first_frame, last_frame  lowest and highest index of a frame in its records; -1: there is none
int CountFramesRead(const SessionStarted& start, int first_frame, int last_frame);

}  // namespace mapmend
