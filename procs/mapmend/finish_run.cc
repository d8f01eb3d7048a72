#include "procs/mapmend/finish_run.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "procs/mapmend/run_tool.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {

std::string FinishRun(const std::string& out, const LauncherFigures& figures, const std::string& db) {
  std::error_code ignored;
  if (!HoldsUndelivered(out)) std::filesystem::remove(out + "/outbox", ignored);  // all of it is in the database
  CompleteSummary(out, figures);
  const std::string log = out + "/logs/viewer_export.log";
  RunTool({"viewer_export", "--report", out}, log, "cannot build the report");
  const std::string folder = std::filesystem::absolute(out).lexically_normal().string();
  std::string files = db.empty() ? "map.db" : "";
  // Without a tracked frame there is no point cloud, and the trajectory is empty.
  if (ReadSummary(out).value("frames_tracked", 0) > 0)
    files += std::string(files.empty() ? "" : ", ") + "map.ply, frames.tum";
  std::string lines = FormatSummaryTable(out) + "  report       " + folder + "/report.html";
  if (!files.empty()) lines += "\n  map          " + folder + "/" + files + (db.empty() ? "" : ", made from " + db);
  return lines;
}

}  // namespace mapmend
