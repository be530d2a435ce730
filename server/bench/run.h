// A run in the bench process: a program through the guard to the device, and what comes back into the
// journal.
//
// Two threads. Acquisition feeds and drains the device and does nothing else; the writer scales and stores. A
// bounded queue of blocks lies between them. If the disk falls behind a real-time run so far that the queue
// is full, or the writer is with one block for 10 s, the run stops safely; a run as fast as possible waits
// instead. Neither ever waits for the server, and neither asks for memory while the program plays and nothing
// has to be said (events, troubles and the end are).
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string_view>
#include <thread>

#include "daq/guard/guard.h"
#include "server/bench/messages.h"
#include "server/bench/recorder.h"

namespace ferrobench::bench {

// Why a bench stops a run though nobody has asked for it.
inline constexpr const char* shuts_down = "the bench shuts down";
inline constexpr const char* server_ended = "the server has ended";
inline constexpr const char* server_silent = "the server did not answer for 5 s";
inline bool broke_off(std::string_view reason) {
  return reason == shuts_down || reason == server_ended || reason == server_silent;
}

class Run {
 public:
  // Moves nothing. Throws Error(limit_exceeded) with every problem of the program, Error(invalid_params) for
  // the rate. `changed` is called by any thread when status(), closed() or the events have changed.
  Run(std::shared_ptr<daq::Device> device, const Prepare& asked, std::function<void()> changed);
  ~Run();  // stops, and waits until the output is at zero
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  Prepared prepared() const;
  // Once. With `urgent` the acquisition from hardware goes before other threads where the system allows it.
  void begin(const Begin& asked, recordings::Descriptor journal, bool urgent);
  bool begun() const { return acquisition_.joinable(); }

  void pause() { guard_.pause(); }
  void resume() { guard_.resume(); }
  void stop(const std::string& reason) { guard_.stop(reason); }
  void hasten() { guard_.hasten(); }

  RunState state() const;
  std::optional<Closed> closed() const;  // without its number; none while it goes on
  bool over() const { return over_; }
  std::deque<recordings::Event> take_events(std::uint64_t& missed);

 private:
  struct Pipe;
  void acquire();
  void write();
  void note(const recordings::Event& event);

  std::shared_ptr<daq::Device> device_;
  std::function<void()> changed_;
  daq::Guard guard_;
  protocols::SampledWaveform program_;
  std::unique_ptr<Pipe> pipe_;
  std::unique_ptr<Recorder> recorder_;
  std::string start_time_;
  bool urgent_ = false;

  mutable std::mutex mutex_;  // over what follows
  std::string failure_;       // of the acquisition
  std::deque<recordings::Event> events_;
  std::uint64_t missed_ = 0;
  std::optional<Closed> closed_;
  std::atomic<bool> over_ = false;

  std::thread writer_, acquisition_;
};

}  // namespace ferrobench::bench
