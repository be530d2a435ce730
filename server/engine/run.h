// One run, as the server knows it. What moves an output is in the bench process (server/bench): it plays the
// program and writes the journal, and says how it goes. The run here follows that, shows the samples that the
// journal gains, and makes the recording's file of it when the run is over.
//
// A bench that dies takes its run along: its successor brings the output to zero, and the file is made of
// what the journal has.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/fields.h"
#include "daq/guard/limits.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/begun.h"
#include "recordings/journal/follower.h"
#include "server/engine/held_device.h"
#include "server/engine/live.h"
#include "server/engine/request.h"
#include "server/rpc/hub.h"

namespace ferrobench::server {

// What may follow what; whoever watches sees them in this order, without those that were over too soon.
//   arming    to the first level               running, stopping, aborted
//   running   until the file is whole          pausing, stopping, complete, aborted
//   pausing   until the next hold              paused, running, stopping, aborted
//   paused    in a hold                        running, stopping, aborted
//   stopping  to zero, until the file is whole aborted
// Before the first run the bench is idle. complete and aborted are for ever.
enum class RunState { idle, arming, running, pausing, paused, stopping, complete, aborted };
std::span<const std::pair<RunState, std::string_view>> enum_names(RunState);
inline bool is_over(RunState s) {
  return s == RunState::idle || s == RunState::complete || s == RunState::aborted;
}

// What ended a run that is over.
//   stopped     somebody did: run.abort, a lease that ran out
//   broken_off  nobody did: a process died, hung or shut down, and the output went to zero
enum class RunEnding { none, complete, stopped, limit, interlock, fault, broken_off };
std::span<const std::pair<RunEnding, std::string_view>> enum_names(RunEnding);

struct RunStatus {
  std::string run{};
  RunState state = RunState::idle;
  RunEnding ending = RunEnding::none;
  std::string reason{};
  std::string protocol{}, title{}, device{};
  std::string recording{}, path{};
  double progress = 0;
  std::optional<double> time_left{};  // s
  double duration = 0;                // s
  std::int64_t rows = 0, rows_on_disk = 0, rows_expected = 0;
  double queue_used = 0;
  double sample_rate = 0;  // Hz
  std::string started{}, ended{};
  bool output_at_zero = true;
  std::string warning{};
};
template <class Visitor>
void describe(Visitor& visit, RunStatus& s) {
  visit("run", s.run, {.required = true, .doc = "its id; \"\" if there was none yet"});
  visit("state", s.state, {.required = true});
  visit("ending", s.ending, {.doc = "what ended it; none while it runs"});
  visit("reason", s.reason, {.doc = "why it was aborted"});
  visit("protocol", s.protocol, {});
  visit("title", s.title, {});
  visit("device", s.device, {});
  visit("recording", s.recording, {.doc = "name of the recording; \"\" if nothing was measured"});
  visit("path", s.path, {.doc = "its file on the daemon's machine"});
  visit("progress", s.progress, {.min = 0, .max = 1, .doc = "share of the rows that have come"});
  visit("time_left_s", s.time_left, {.unit = "s", .doc = "estimated, while it runs"});
  visit("duration_s", s.duration, {.unit = "s", .doc = "of the whole program, pauses so far included"});
  visit("rows", s.rows, {.min = 0});
  visit("rows_on_disk", s.rows_on_disk, {.min = 0, .doc = "these survive a power cut"});
  visit("rows_expected", s.rows_expected, {.min = 0});
  visit("queue_used", s.queue_used,
        {.min = 0, .max = 1, .doc = "most so far, as a share, of the queue between device and disk"});
  visit("sample_rate_Hz", s.sample_rate, {.unit = "Hz"});
  visit("started", s.started, {.doc = "ISO 8601"});
  visit("ended", s.ended, {.doc = "ISO 8601, \"\" while it runs"});
  visit("output_at_zero", s.output_at_zero, {.doc = "false while it runs, or if the device did not obey"});
  visit("warning", s.warning, {.doc = "what the person at the bench must do now; \"\" if nothing"});
}

struct RunSetup {
  std::string id{};
  std::string identifier{};  // of the recording; "": a new one
  RunPlan plan{};
  std::shared_ptr<HeldDevice> device{};
  bool last_use = true;  // the device is closed when the run is over
  std::string device_name{};
  daq::Limits limits{};
  std::string path{};  // of the recording
  recordings::Existing existing = recordings::Existing::keep;
  std::function<std::string()> next_path{};  // where it goes if the path has just gone to another program
  std::string notes{};
  std::string rerun_of{};  // identifier of the recording that this run repeats
  bool real_time = true;
  std::function<void(const recordings::Rows&)> watch{};  // sees all that is measured
  std::function<std::string()> stop_wanted{};            // asked again and again: why the run must end, or ""
  std::string folder{};  // where another server finds the bench if this one dies; "": none is to
};

class Run : private RunWatcher {
 public:
  // Everything that can be refused is refused here, before anything moves: Error(limit_exceeded) with every
  // problem of the program, Error(invalid_params) for the rate, Error(io_error | disk_full) for the file.
  Run(RunSetup setup, Hub& hub);
  // The run of a bench that has lost its server, which goes on. Throws Error if nothing can be made of it.
  Run(std::shared_ptr<BenchLink> link, std::function<std::string()> stop_wanted, Hub& hub);
  ~Run() override;  // aborts, and waits until the output is at zero
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  // Once, and at once. With `stopped`, the reason of a stop that came before: nothing moves.
  void begin(const std::string& stopped = "");

  const std::string& id() const { return setup_.id; }
  RunStatus status() const;
  bool output_at_zero() const;        // before the file is whole, too
  std::size_t queued_blocks() const;  // acquired, not yet with the writer
  bool over() const;

  // Error(bad_state) where that makes no sense now.
  void pause();
  void resume();
  void abort(const std::string& reason, bool again = false);  // a safe stop; see Engine
  void stop(const std::string& reason);                       // a safe stop that nobody asked for
  void hasten();                                              // see Guard
  void wait();                                                // until the recording is whole

 private:
  void status(const bench::RunState& state) override;
  void event(const bench::Noted& event) override;
  void closed(const bench::Closed& closed) override;
  void lost(const std::string& why) override;

  void prepare();
  std::string card() const;
  void follow();
  void show();
  void finish(const bench::Closed& closed);
  void recover(const std::string& why);
  template <class M>
  void order_at_once(const M& order);
  void end(RunEnding ending, const std::string& reason, bool recorded);
  void publish(const recordings::Event& event);
  void tell();

  RunSetup setup_;
  Hub& hub_;
  std::shared_ptr<BenchLink> link_;
  std::uint32_t number_ = 0;  // on the bench
  double rate_ = 1;           // Hz
  std::vector<recordings::Event> first_events_;
  std::optional<recordings::BegunRecording> recording_;
  std::optional<recordings::JournalFollower> follower_;
  std::optional<LiveStream> live_;
  std::string started_;
  std::chrono::steady_clock::time_point begin_;

  mutable std::mutex mutex_;  // over what follows
  std::condition_variable changed_;
  bench::RunState last_;
  std::optional<bench::Closed> closed_;
  std::optional<std::string> lost_;
  RunState state_ = RunState::arming;
  RunEnding ending_ = RunEnding::none;
  std::string reason_, ended_, warning_;
  bool at_zero_ = false;
  bool recorded_ = true;

  bool begun_ = false;
  std::atomic<bool> asked_to_stop_ = false;
  std::mutex losing_;
  std::mutex telling_;  // what is told comes in the order in which it was so
  std::mutex joining_;
  std::thread follower_thread_;
};

}  // namespace ferrobench::server
