#include "libs/features/features.h"

namespace mapmend {

double Pyramid::Scale(int octave) const {
  double scale = 1.0;
  for (int i = 0; i < octave; ++i) scale *= scale_factor;
  return scale;
}

}  // namespace mapmend
