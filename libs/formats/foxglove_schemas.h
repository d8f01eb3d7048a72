#pragma once

#include <string>

namespace mapmend {

// The JSON schema of a message that Foxglove knows by this name (https://docs.foxglove.dev/docs/sdk/schemas):
// foxglove.PointCloud, foxglove.PosesInFrame, foxglove.PoseInFrame, foxglove.FrameTransform, foxglove.SceneUpdate,
// foxglove.CameraCalibration, foxglove.Log. Throws std::logic_error for others.
std::string FoxgloveSchema(const std::string& name);

}  // namespace mapmend
