#include "libs/stream/revision.h"

namespace mapmend {

bool IsWide(const EvaluatedConnection& connection) { return connection.reason.starts_with(kWideReason); }

bool IsWeak(const EvaluatedConnection& connection) {
  return connection.verdict == EvaluatedConnection::Verdict::kAccepted &&
         connection.reason.find(kWeakReason) != std::string::npos;
}

const char* KindOf(const EvaluatedConnection& connection) { return IsWide(connection) ? "wide" : "orb"; }

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
