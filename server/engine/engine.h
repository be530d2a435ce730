// The bench as a whole: its store, devices, limits, the one run under way and those before it.
// Everything here is safe to call from any thread.
//
// Its lock is held for no longer than it takes to look something up: a device that opens, closes or answers,
// a recording that is read and a file that is made keep neither status() nor abort() waiting. A run that is
// being prepared has the bench for itself; a stop that comes by then reaches the run before it moves.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "daq/selftest.h"
#include "server/engine/benches.h"
#include "server/engine/hazards.h"
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

using DeviceOpener = bench::Opener;

class Engine {
 public:
  // Adds the topics run, samples, events and job to the hub, which outlives the engine. `opener`: opens the
  // devices, in this process; none: a bench process does.
  Engine(const std::filesystem::path& data_folder, Hub& hub, DeviceOpener opener = {});
  ~Engine() { stop(); }
  // Ends what is under way safely and returns when the output is at zero. Nothing starts after.
  void stop();

  // For a daemon, before its first run: the run of a bench that has lost its server, if there is one in the
  // data folder, goes on as the run of this engine, and this engine's runs wait for the next daemon in their
  // turn. What was found, in a sentence; "" if nothing was. Without it a run whose program dies ends by
  // itself. Waits, for 5 s at most, while a recording of the folder is written by a bench that does not
  // answer.
  std::string take_over();
  // Starts the bench process now rather than when it is first needed: what it lacks to be on time on a busy
  // machine, or "". Error(device_unavailable).
  std::string start_bench() { return benches_.start(); }

  // One run or self-test goes on at a time: Error(busy). A request whose idempotency key was seen before
  // starts nothing and returns that run. `path`: where the recording goes, "" for a new one in the store.
  // While it is prepared the run is arming; if it is stopped then, it is aborted and its output never moves.
  RunStatus start(const RunRequest& request, const std::string& path = "");
  // `id` "": the latest; state idle if there was none; with what the bench warns of. Error(not_found).
  RunStatus status(const std::string& id = "") const;
  std::vector<RunStatus> runs() const;  // newest first
  RunTotals totals() const;
  std::size_t queued_blocks() const;  // of samples, not yet with the writer
  RunStatus wait(const std::string& id);
  // These answer with the run that they reached: where `id` is "", another may be the latest by then.
  RunStatus pause(const std::string& id);
  RunStatus resume(const std::string& id);
  // `id` "": a self-test too. A second one hastens the stop, unless it is the same one `again`.
  RunStatus abort(const std::string& id, const std::string& reason, bool again = false);
  void hasten();  // the stop under way, if there is one
  // Whether the run under way writes this recording.
  bool is_being_written(const std::filesystem::path& path) const;

  daq::Limits limits() const;
  // {"field_max": 1e6}: changes what it names. Error(invalid_params), Error(busy) during a run. `reason` may
  // be "" unless a stop may take longer than usual.
  void set_limits(const nlohmann::json& named, const std::string& reason = "");

  // A device that stays open keeps the state of its specimen from run to run.
  std::string open_device(const std::string& kind, const nlohmann::json& config);
  void close_device(const std::string& id);
  std::vector<std::string> open_devices() const;
  // What an open device says now, which is for `use` alone meanwhile and not for long; Error(busy) while a
  // run or a test has it.
  void with_device(const std::string& id, const std::function<void(const daq::DeviceFacts&)>& use);
  // The bench waits for nothing meanwhile. Stopped like a run, with Error(cancelled); errors as
  // daq::selftest.
  daq::SelftestReport selftest(const std::string& id, double rate = daq::selftest_rate);

  const Store& store() const { return store_; }
  Jobs& jobs() { return jobs_; }
  Lease& lease() { return lease_; }
  Hazards& hazards() { return hazards_; }
  Hub& hub() { return hub_; }
  double uptime() const;  // s
  // Of the run under way, whose file may not be whole yet.
  bool output_at_zero() const;

 private:
  struct Asked {
    std::string key{};         // "": none
    nlohmann::json request{};  // where there is a key
  };
  struct Preparing {
    RunStatus status{};  // its reason: why it was stopped already
    Asked asked{};
  };
  // A device that is open, for one user at a time.
  struct Open {
    std::shared_ptr<HeldDevice> device{};
    bool used = false;
  };
  using Lock = std::unique_lock<std::mutex>;

  std::optional<RunStatus> repeated(const Asked& asked, Lock& lock);
  RunSetup make_setup(const RunRequest& request, RunSetup setup, std::shared_ptr<HeldDevice> open);
  RunStatus latest() const;
  std::shared_ptr<Run> current(const std::string& id) const;
  Open& find_device(const std::string& id);
  // Waits until nobody uses it. Error(busy) as soon as a run or a test has it.
  Open& free_device(const std::string& id, const std::string& what, Lock& lock);
  void demand_rest(const std::string& what) const;
  void demand_free(const std::string& device, const std::string& what) const;

  Hub& hub_;
  Store store_;
  Lease lease_;
  mutable Hazards hazards_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();

  Benches benches_;
  std::atomic<bool> takes_over_ = false;
  mutable std::mutex mutex_;
  std::condition_variable changed_;  // a device, the self-test or the run being prepared
  daq::Limits limits_;
  std::map<std::string, Open> devices_;
  std::string tested_;     // device that a self-test has, "": none
  std::string test_stop_;  // why that must end, "": it need not
  std::optional<Preparing> preparing_;
  std::shared_ptr<Run> run_;
  Asked asked_;                                   // for run_
  std::deque<std::pair<RunStatus, Asked>> past_;  // newest first
  RunTotals forgotten_;                           // runs that past_ has no more room for
  std::uint64_t last_device_ = 0;
  bool stopped_ = false;
  Jobs jobs_;  // last: its threads end first
};

}  // namespace ferrobench::server
