#pragma once

#include "libs/features/features.h"
#include "libs/features/wide_features.h"

namespace mapmend {

// Wide features in the form of ORB's, so that whatever follows needs to know one kind only: 256 bits instead of 128
// bytes, a pyramid level instead of a size. Signs of the bytes against their median and their upper quartile (after
// Zhou et al., Scalar quantization for large scale image search, ACM Multimedia 2012). Two of the same thing differ in
// some 26 bits, rarely in more than 47: limits for ORB fit them. They are not to be compared with ORB's.
Features SignaturesOf(const WideFeatures& wide, const Pyramid& pyramid);

}  // namespace mapmend
