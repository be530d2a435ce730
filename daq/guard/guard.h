// The guard: the only way to a device. It checks a program before the start, limits every level that goes
// out, watches what comes back, and whatever happens brings the output to zero at a bounded slew.
//
//     Guard guard(device, limits, interlock);
//     guard.go_to(program.value(0), slew);
//     guard.start(program);
//     while (guard.read(block)) ...            // the rows that are recorded, with command and events
//     guard.outcome(); guard.segments();
//
// A guard serves one run. go_to, start, read and release belong to one thread. pause, resume, stop, progress
// and outcome may be called from any. However this scope is left, the output is at zero after. A guard that
// was released leaves the device alone, which may serve another one by then.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "daq/device.h"
#include "daq/guard/feed.h"
#include "daq/guard/limits.h"
#include "daq/guard/trips.h"
#include "protocols/waveform.h"

namespace ferrobench::daq {

struct Outcome {
  End end = End::none;
  std::string reason;  // empty if complete
  bool output_at_zero = false;
  std::string warning{};  // what to do if it is not
};

struct Progress {
  enum class State { idle, running, pausing, paused, stopping, ended };
  State state = State::idle;
  std::uint64_t rows_read = 0;      // of the device, recorded or not
  std::uint64_t rows_expected = 0;  // grows while paused
  double rate = 0;                  // rows/s
};

// True while it is safe to have a field at the output. Asked in every block.
using Interlock = std::function<bool()>;

class Guard final : private LevelSource {
 public:
  // Throws Error(invalid_params) if the limits make no sense. The device outlives the guard.
  Guard(Device& device, const Limits& limits, Interlock interlock = {});
  ~Guard() override;
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;

  // The limits in force: those given, within what the device's output can reach.
  const Limits& limits() const { return limits_; }

  // Brings the output to `level` at `slew` [V/m/s], or less where the limits ask for it.
  // Throws Error(limit_exceeded | interlock_open), Error(cancelled) after a stop().
  void go_to(double level, double slew);
  // Throws Error(limit_exceeded) with every problem of the program, Error(interlock_open), Error(bad_state)
  // if the output is not at its first level.
  void start(protocols::SampledWaveform program);
  // False: the run is over, the output at zero (unless outcome() says otherwise). Never throws for a failing
  // device.
  bool read(SampleBlock& block);
  // Brings the output to zero unless the run's end did, and is the last that the guard does with the device;
  // the destructor does it where nobody did.
  void release() noexcept;

  // Keeps the field where it is once the program is in a hold (now or later); samples keep coming and the
  // hold gets longer. Throws Error(bad_state) if no hold is left or nothing runs.
  void pause();
  void resume();
  // Leaves the program: the output ramps to zero at stop_slew, with samples, and read() then ends.
  void stop(const std::string& reason);
  // Whatever is on its way to zero, now or later, goes as fast as the limits and the amplifier allow.
  void hasten();

  Progress progress() const;
  Outcome outcome() const;
  // The segment table as played: holds longer by their pauses, cut at a stop, the way back as a ramp "safe
  // stop".
  std::vector<recordings::SegmentRow> segments() const;

 private:
  LinearPiece next(std::uint64_t max_samples) override;
  std::size_t next_levels(std::span<double> levels) override;
  bool interlock_closed() const;
  void demand_interlock() const;
  void demand_fresh();
  std::string fault_in(SampleBlock& block);
  void account(SampleBlock& block);
  bool finish(End end, std::string reason, SampleBlock& block);
  double stop_slew() const;
  void make_safe() noexcept;

  Device& device_;
  Limits limits_;
  double fastest_stop_;  // V/m/s
  Interlock interlock_;
  std::size_t columns_;
  Trips trips_;

  mutable std::mutex mutex_;  // over everything below
  std::optional<Feed> feed_;
  Outcome outcome_;
  std::optional<std::string> stop_wanted_;  // before there was a feed to tell
  std::uint64_t rows_read_ = 0;
  bool hastened_ = false;
  int silent_reads_ = 0;
  bool released_ = false;
  BlockStatus last_status_ = BlockStatus::ok;
  std::string last_trouble_;  // of the last block
};

}  // namespace ferrobench::daq
