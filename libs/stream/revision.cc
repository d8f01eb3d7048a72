#include "libs/stream/revision.h"

namespace mapmend {

const char* ReasonPrefix(ConnectionKind kind) {
  switch (kind) {
    case ConnectionKind::kOrb:
      return "";
    case ConnectionKind::kWide:
      return "wide features: ";
    case ConnectionKind::kMotion:
      return "motion: ";
  }
  return "";
}

ConnectionKind KindOf(const EvaluatedConnection& connection) {
  for (const ConnectionKind kind : {ConnectionKind::kWide, ConnectionKind::kMotion}) {
    if (connection.reason.starts_with(ReasonPrefix(kind))) return kind;
  }
  return ConnectionKind::kOrb;
}

const char* ToString(ConnectionKind kind) {
  switch (kind) {
    case ConnectionKind::kOrb:
      return "orb";
    case ConnectionKind::kWide:
      return "wide";
    case ConnectionKind::kMotion:
      return "motion";
  }
  return "";
}

bool IsWeak(const EvaluatedConnection& connection) {
  return connection.verdict == EvaluatedConnection::Verdict::kAccepted &&
         connection.reason.find(kWeakReason) != std::string::npos;
}

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
