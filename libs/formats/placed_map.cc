#include "libs/formats/placed_map.h"

#include "libs/base/text_format.h"

namespace mapmend {

std::string Describe(const FrameOfReference& frame) {
  std::string text = "frame " + frame.name;
  if (frame.epsg > 0) text += " (EPSG:" + std::to_string(frame.epsg) + ")";
  text += ", unit " + (frame.unit == "m" ? "metre" : frame.unit + " (arbitrary)");
  if (!frame.note.empty()) text += ": " + frame.note;
  if (!frame.origin.isZero(0))
    text += Format("; add %.3f %.3f %.3f to the coordinates", frame.origin.x(), frame.origin.y(), frame.origin.z());
  return text;
}

}  // namespace mapmend
