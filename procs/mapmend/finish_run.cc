#include "procs/mapmend/finish_run.h"

#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <thread>

#include "procs/mapmend/paths.h"
#include "procs/mapmend/supervisor.h"

namespace mapmend {

std::string FinishRun(const std::string& out, const LauncherFigures& figures, const std::string& db) {
  std::error_code ignored;
  std::filesystem::remove(out + "/outbox", ignored);  // all of it is in the database
  CompleteSummary(out, figures);
  const std::string log = out + "/logs/viewer_export.log";
  ChildProcess report({FindProgram("viewer_export"), "--report", out}, log);
  std::optional<ExitStatus> status;
  while (!(status = report.Poll())) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  if (!status->Success())
    throw std::runtime_error("cannot build the report: " + FindErrorLine(log, "viewer_export", 0));
  const std::string folder = std::filesystem::absolute(out).lexically_normal().string();
  return FormatSummaryTable(out) + "  report       " + folder + "/report.html\n  map          " +
         (db.empty() ? folder + "/map.db, map.ply, frames.tum" : folder + "/map.ply, frames.tum, made from " + db);
}

}  // namespace mapmend
