#include "libs/stream/revision.h"

namespace mapmend {

const char* ToString(EvaluatedConnection::Verdict verdict) {
  switch (verdict) {
    case EvaluatedConnection::Verdict::kAccepted:
      return "accepted";
    case EvaluatedConnection::Verdict::kRejected:
      return "rejected";
    case EvaluatedConnection::Verdict::kDeactivated:
      return "deactivated";
  }
  return "";
}

}  // namespace mapmend
