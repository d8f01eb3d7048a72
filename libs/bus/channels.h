#pragma once

#include <string>

// Channel names (docs/protocol.md). A bus may put a prefix before them, so that several runs share one hub.
namespace mapmend::channels {

inline constexpr char kSession[] = "MAPMEND_SESSION";
inline constexpr char kSubmap[] = "MAPMEND_SUBMAP";
inline constexpr char kKeyframe[] = "MAPMEND_KEYFRAME";
inline constexpr char kMapUpdate[] = "MAPMEND_MAP_UPDATE";
inline constexpr char kWideFeatures[] = "MAPMEND_WIDE_FEATURES";
inline constexpr char kPositions[] = "MAPMEND_POSITIONS";
inline constexpr char kAck[] = "MAPMEND_ACK";
inline constexpr char kStoreStarted[] = "MAPMEND_STORE_STARTED";
inline constexpr char kStreamState[] = "MAPMEND_STREAM_STATE";
inline constexpr char kBowQuery[] = "MAPMEND_BOW_QUERY";
inline constexpr char kBowResult[] = "MAPMEND_BOW_RESULT";
inline constexpr char kFetch[] = "MAPMEND_FETCH";
inline constexpr char kFetched[] = "MAPMEND_FETCHED";
inline constexpr char kConnection[] = "MAPMEND_CONNECTION";
inline constexpr char kMergedTransforms[] = "MAPMEND_MERGED_TRANSFORMS";
inline constexpr char kRevision[] = "MAPMEND_REVISION";
inline constexpr char kRevisionPart[] = "MAPMEND_REVISION_PART";
inline constexpr char kRevisionAck[] = "MAPMEND_REVISION_ACK";
inline constexpr char kRevisionFetch[] = "MAPMEND_REVISION_FETCH";
inline constexpr char kRevisionFetched[] = "MAPMEND_REVISION_FETCHED";
inline constexpr char kCloseSession[] = "MAPMEND_CLOSE_SESSION";
inline constexpr char kSessionClosed[] = "MAPMEND_SESSION_CLOSED";
inline constexpr char kProgressRequest[] = "MAPMEND_PROGRESS_REQUEST";
inline constexpr char kProgress[] = "MAPMEND_PROGRESS";
inline constexpr char kEdgeRequest[] = "MAPMEND_EDGE_REQUEST";
inline constexpr char kEdgeDecisions[] = "MAPMEND_EDGE_DECISIONS";
inline constexpr char kGraphRequest[] = "MAPMEND_GRAPH_REQUEST";
inline constexpr char kGraph[] = "MAPMEND_GRAPH";
inline constexpr char kFramePose[] = "MAPMEND_FRAME_POSE";
inline constexpr char kImage[] = "MAPMEND_IMAGE";
inline constexpr char kKeyframeImage[] = "MAPMEND_KEYFRAME_IMAGE";
inline constexpr char kImageRequest[] = "MAPMEND_IMAGE_REQUEST";
inline constexpr char kImageFetch[] = "MAPMEND_IMAGE_FETCH";
inline constexpr char kImageFetched[] = "MAPMEND_IMAGE_FETCHED";
inline constexpr char kImageStatusRequest[] = "MAPMEND_IMAGE_STATUS_REQUEST";
inline constexpr char kImageStatus[] = "MAPMEND_IMAGE_STATUS";
inline constexpr char kGps[] = "MAPMEND_GPS";
inline constexpr char kHealth[] = "MAPMEND_HEALTH";

}  // namespace mapmend::channels
