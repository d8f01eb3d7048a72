#include "libs/formats/foxglove_schemas.h"

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace mapmend {
namespace {

using Json = nlohmann::ordered_json;

Json Type(const char* name) { return {{"type", name}}; }
Json Number() { return Type("number"); }
Json Integer() { return Type("integer"); }
Json Text() { return Type("string"); }
Json Object(const Json& properties) { return {{"type", "object"}, {"properties", properties}}; }
Json ArrayOf(const Json& items) { return {{"type", "array"}, {"items", items}}; }
Json Numbers(int count) {
  Json array = ArrayOf(Number());
  if (count > 0) array["minItems"] = array["maxItems"] = count;
  return array;
}

Json Time() { return Object({{"sec", Integer()}, {"nsec", Integer()}}); }
Json Vector() { return Object({{"x", Number()}, {"y", Number()}, {"z", Number()}}); }
Json Quaternion() { return Object({{"x", Number()}, {"y", Number()}, {"z", Number()}, {"w", Number()}}); }
Json Pose() { return Object({{"position", Vector()}, {"orientation", Quaternion()}}); }
Json Color() { return Object({{"r", Number()}, {"g", Number()}, {"b", Number()}, {"a", Number()}}); }

Json PointCloud() {
  const Json field = Object({{"name", Text()}, {"offset", Integer()}, {"type", Integer()}});
  return Object({{"timestamp", Time()},
                 {"frame_id", Text()},
                 {"pose", Pose()},
                 {"point_stride", Integer()},
                 {"fields", ArrayOf(field)},
                 {"data", {{"type", "string"}, {"contentEncoding", "base64"}}}});
}

Json FrameTransform() {
  return Object({{"timestamp", Time()},
                 {"parent_frame_id", Text()},
                 {"child_frame_id", Text()},
                 {"translation", Vector()},
                 {"rotation", Quaternion()}});
}

// Of the primitives only lines and texts, which are all that mapmend draws.
Json SceneUpdate() {
  const Json line = Object({{"type", Integer()},
                            {"pose", Pose()},
                            {"thickness", Number()},
                            {"scale_invariant", Type("boolean")},
                            {"points", ArrayOf(Vector())},
                            {"color", Color()},
                            {"colors", ArrayOf(Color())},
                            {"indices", ArrayOf(Integer())}});
  const Json text = Object({{"pose", Pose()},
                            {"billboard", Type("boolean")},
                            {"font_size", Number()},
                            {"scale_invariant", Type("boolean")},
                            {"color", Color()},
                            {"text", Text()}});
  const Json pair = Object({{"key", Text()}, {"value", Text()}});
  Json entity = {{"timestamp", Time()},
                 {"frame_id", Text()},
                 {"id", Text()},
                 {"lifetime", Time()},
                 {"frame_locked", Type("boolean")},
                 {"metadata", ArrayOf(pair)},
                 {"lines", ArrayOf(line)},
                 {"texts", ArrayOf(text)}};
  for (const char* other : {"arrows", "cubes", "spheres", "cylinders", "triangles", "models"})
    entity[other] = ArrayOf(Type("object"));
  const Json deletion = Object({{"timestamp", Time()}, {"type", Integer()}, {"id", Text()}});
  return Object({{"deletions", ArrayOf(deletion)}, {"entities", ArrayOf(Object(entity))}});
}

Json CameraCalibration() {
  return Object({{"timestamp", Time()},
                 {"frame_id", Text()},
                 {"width", Integer()},
                 {"height", Integer()},
                 {"distortion_model", Text()},
                 {"D", Numbers(0)},
                 {"K", Numbers(9)},
                 {"R", Numbers(9)},
                 {"P", Numbers(12)}});
}

Json Log() {
  return Object({{"timestamp", Time()},
                 {"level", Integer()},
                 {"message", Text()},
                 {"name", Text()},
                 {"file", Text()},
                 {"line", Integer()}});
}

Json Schema(const std::string& name) {
  if (name == "foxglove.PointCloud") return PointCloud();
  if (name == "foxglove.PosesInFrame")
    return Object({{"timestamp", Time()}, {"frame_id", Text()}, {"poses", ArrayOf(Pose())}});
  if (name == "foxglove.PoseInFrame") return Object({{"timestamp", Time()}, {"frame_id", Text()}, {"pose", Pose()}});
  if (name == "foxglove.FrameTransform") return FrameTransform();
  if (name == "foxglove.SceneUpdate") return SceneUpdate();
  if (name == "foxglove.CameraCalibration") return CameraCalibration();
  if (name == "foxglove.Log") return Log();
  throw std::logic_error("no schema " + name);
}

}  // namespace

std::string FoxgloveSchema(const std::string& name) {
  Json schema = Schema(name);
  schema["title"] = name;
  return schema.dump();
}

}  // namespace mapmend
