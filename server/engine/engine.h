// The bench as a whole: its store, devices, limits, the one run under way and those before it.
// Everything here is safe to call from any thread.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "daq/selftest.h"
#include "server/engine/jobs.h"
#include "server/engine/lease.h"
#include "server/engine/run.h"
#include "server/engine/store.h"

namespace ferrobench::server {

// Of all runs since the start.
struct RunTotals {
  std::uint64_t complete = 0, aborted = 0;
  std::int64_t rows = 0, rows_on_disk = 0;
  void add(const RunStatus& run);
};

class Engine {
 public:
  // Adds the topics run, samples, events and job to the hub, which outlives the engine.
  Engine(const std::filesystem::path& data_folder, Hub& hub);
  ~Engine() { stop(); }
  // Ends what is under way safely and returns when the output is at zero. Nothing starts after.
  void stop();

  // One run or self-test goes on at a time: Error(busy). A request whose idempotency key was seen before
  // starts nothing and returns that run. `path`: where the recording goes, "" for a new one in the store.
  RunStatus start(const RunRequest& request, const std::string& path = "");
  // `id` "": the latest; state idle if there was none. Error(not_found).
  RunStatus status(const std::string& id = "") const;
  std::vector<RunStatus> runs() const;  // newest first
  RunTotals totals() const;
  std::size_t queued_blocks() const;  // of samples, not yet with the writer
  RunStatus wait(const std::string& id);
  void pause(const std::string& id);
  void resume(const std::string& id);
  void abort(const std::string& id, const std::string& reason);  // `id` "": a self-test too
  // Whether the run under way writes this recording.
  bool is_being_written(const std::filesystem::path& path) const;

  daq::Limits limits() const;
  // {"field_max": 1e6}: changes what it names. Error(invalid_params), Error(busy) during a run.
  void set_limits(const nlohmann::json& named);

  // A device that stays open keeps the state of its specimen from run to run.
  std::string open_device(const std::string& kind, const nlohmann::json& config);
  void close_device(const std::string& id);
  std::vector<std::string> open_devices() const;
  // An open device, for `use` alone and not for long; Error(busy) while a run or a test has it.
  void with_device(const std::string& id, const std::function<void(daq::Device&)>& use);
  // The bench waits for nothing meanwhile. Stopped like a run, with Error(cancelled); errors as
  // daq::selftest.
  daq::SelftestReport selftest(const std::string& id);

  const Store& store() const { return store_; }
  Jobs& jobs() { return jobs_; }
  Lease& lease() { return lease_; }
  Hub& hub() { return hub_; }
  double uptime() const;  // s

 private:
  RunSetup make_setup(const RunRequest& request) const;
  std::shared_ptr<Run> current(const std::string& id) const;
  std::shared_ptr<daq::Device> find_device(const std::string& id) const;
  void demand_rest(const std::string& what) const;
  void demand_free(const std::string& device, const std::string& what) const;

  Hub& hub_;
  Store store_;
  Lease lease_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();

  mutable std::mutex mutex_;
  daq::Limits limits_;
  std::map<std::string, std::shared_ptr<daq::Device>> devices_;
  std::string tested_;     // device that a self-test has, "": none
  std::string test_stop_;  // why that must end, "": it need not
  std::condition_variable test_over_;
  std::shared_ptr<Run> run_;
  struct Asked {
    std::string key{};         // "": none
    nlohmann::json request{};  // where there is a key
  };
  Asked asked_;                                   // for run_
  std::deque<std::pair<RunStatus, Asked>> past_;  // newest first
  RunTotals forgotten_;                           // runs that past_ has no more room for
  std::uint64_t last_device_ = 0;
  bool stopped_ = false;
  Jobs jobs_;  // last: its threads end first
};

}  // namespace ferrobench::server
