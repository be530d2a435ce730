#include "server/methods/recording_rows.h"

#include <filesystem>

#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {

namespace fs = std::filesystem;

namespace {

RecordingRow row_of(const std::string& path, const recordings::SummaryOrError& read) {
  RecordingRow row{.name = fs::path(path).stem().string()};
  std::error_code failure;
  row.bytes = static_cast<std::int64_t>(fs::file_size(recordings::present_file(path), failure));
  if (const auto* error = std::get_if<Error>(&read)) {
    row.status = "unreadable";
    row.reason = error->problems().empty() ? error->message() : error->problems().front().message;
    return row;
  }
  const auto& s = std::get<recordings::Summary>(read);
  row.title = s.header.title;
  row.protocol = text_at(s.header.protocol, "name");
  row.model = text_at(s.header.model, "name");
  row.device = text_at(s.header.device, "driver");
  row.start_time = s.header.start_time;
  row.duration = s.duration;
  row.spring = s.header.load.spring_stiffness;
  row.prestress = s.header.load.prestress;
  row.rows = static_cast<std::int64_t>(s.rows);
  row.status = s.status;
  row.reason = s.reason;
  return row;
}

}  // namespace

nlohmann::json table_schema() {
  using namespace schema;
  const auto column = object(
      {{"key", text()},
       {"title", text()},
       {"unit", text("as people read it")},
       {"uncertainty", text("key of the standard uncertainties in its rows, in the column's unit; absent: "
                            "none are stated")}});
  return object({{"title", text()},
                 {"columns", list_of(column, "in order")},
                 {"rows", list_of(any_object())},
                 {"notes", list_of(text())}},
                any());
}

std::vector<RecordingRow> rows_of(const std::vector<std::string>& paths) {
  const auto read = recordings::read_summaries(paths);
  std::vector<RecordingRow> out;
  out.reserve(paths.size());
  for (std::size_t i = 0; i < paths.size(); ++i) out.push_back(row_of(paths[i], read[i]));
  return out;
}

}  // namespace ferrobench::server
