#include "server/engine/table_runs.h"

#include <algorithm>
#include <filesystem>
#include <thread>

#include "daq/registry.h"
#include "recordings/file/reader.h"
#include "server/engine/live.h"
#include "server/engine/run.h"

namespace ferrobench::server {

namespace fs = std::filesystem;

namespace {

// A folder of its own, gone at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    auto name = (fs::temp_directory_path() / "ferrobench-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw Error(ErrorCode::io_error, "no temporary folder can be made", Problem{.given = name});
    path = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  fs::path path;
};

// Until all are over.
void follow(const std::vector<std::unique_ptr<Run>>& runs, const std::function<bool(double)>& progress) {
  while (!std::ranges::all_of(runs, [](const auto& run) { return run->over(); })) {
    double done = 0;
    for (const auto& run : runs) done += run->status().progress;
    if (!progress(done / static_cast<double>(runs.size()))) {
      for (const auto& run : runs) run->abort("the table was stopped");
      throw Error(ErrorCode::cancelled, "the table was stopped");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace

std::vector<RunRequest> table_requests(const std::string& table, const nlohmann::json& model,
                                       const nlohmann::json& set, std::int64_t seed) {
  const auto published = recordings::published_table(table);
  const auto& e = published.description;
  RunRequest request{.protocol = e.protocol,
                     .model = model.is_null() ? nlohmann::json(e.specimen) : model,
                     .fast = true,
                     .seed = seed,
                     .set = set};
  for (const auto& [name, value] : e.parameters.items())
    if (!set.contains(name)) request.set[name] = value;
  const auto* key = published.run_key();
  if (key == nullptr) return {request};
  std::vector<RunRequest> out;
  for (const double value : published.run_values()) {
    auto next = request;
    next.set[key->setting] = value;
    out.push_back(std::move(next));
  }
  return out;
}

recordings::Comparison run_table(const std::string& table, const std::vector<RunRequest>& requests,
                                 const Store& store, const std::string& keep,
                                 const std::function<bool(double)>& progress) {
  const TemporaryFolder folder;
  if (!keep.empty()) fs::create_directories(keep);
  Hub nobody;
  nobody.add_topic({.name = "run", .doc = ""});
  nobody.add_topic({.name = "events", .doc = ""});
  nobody.add_topic(samples_topic());
  std::vector<std::unique_ptr<Run>> runs;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    auto plan = make_plan(requests[i], store);
    auto device = std::make_shared<HeldDevice>(daq::open_device(requests[i].device, plan.device_config));
    const auto name = plan.protocol.name() + "_" + table + "_" + std::to_string(i + 1) + ".h5";
    runs.push_back(
        std::make_unique<Run>(RunSetup{.id = name,
                                       .plan = std::move(plan),
                                       .device = std::move(device),
                                       .device_name = requests[i].device,
                                       .limits = {},
                                       .path = (keep.empty() ? folder.path : fs::path(keep)) / name,
                                       .real_time = false},
                              nobody));
    runs.back()->begin();
  }
  follow(runs, progress);
  std::vector<recordings::Recording> recorded;
  for (auto& run : runs) {
    run->wait();
    const auto status = run->status();
    if (status.state != RunState::complete)
      throw Error(ErrorCode::cancelled, "a run of the table was aborted: " + status.reason);
    recorded.push_back(recordings::read_recording(status.path));
  }
  return compare(recordings::published_table(table), recorded);
}

}  // namespace ferrobench::server
