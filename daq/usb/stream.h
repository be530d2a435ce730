// One run of input and output together: a thread that owns the link from the start to the end of the scans.
//
// Output goes in tick by tick as input comes out: there are never more than queue_ahead seconds of it between
// host and converter, and the unit's own pacer sets the speed. Samples are handed on only after a look at the
// unit's status that came later than they did, and after the watch has seen them: samples from after an
// overrun, or from another channel, never reach a recording.
//
// Ends by itself when the source is over and its last row has come, with the last level written out once
// more. Ends at any trouble with a last block that says what happened; samples that nothing vouches for are
// not in it.
#pragma once

#include <atomic>
#include <optional>
#include <thread>

#include "daq/usb/block_queue.h"
#include "daq/usb/inputs.h"
#include "daq/usb/output_feed.h"
#include "daq/usb/pace.h"
#include "daq/usb/pace_watch.h"
#include "daq/usb/tick_cutter.h"
#include "daq/usb/transfers.h"
#include "daq/usb/watch.h"

namespace ferrobench::daq::usb {

struct StreamPlan {
  Pace pace;
  StartConfig start;
  std::optional<MonitorCheck> monitor_check;
  double queue_ahead = 0.05;  // s
  double level = 0;           // V/m, at the output now
  int output_channel = 0;
  std::uint8_t latch = 0;  // digital outputs as they are, DIO0 low
  std::optional<int> interlock_bit;
};

// Where the output stands after a stream.
struct Rest {
  bool known = false;  // else `level` is the best guess, and it is within lowest..highest
  double level = 0;    // V/m
  double lowest = 0, highest = 0;
  bool transfers_back = true;  // false: the link still holds buffers and must be closed
  bool lost = false;           // the unit is gone
};

class Stream {
 public:
  // Arms, starts, and leaves the rest to a thread. All references outlive it. Throws what went wrong, with
  // both scans stopped as far as the unit answers; `rest` says then where the output is.
  Stream(Unit& unit, Transfers& transfers, const Inputs& inputs, const StreamPlan& plan, LevelSource& source,
         OutputFeed::ToCode to_code, HostClock& clock, Rest& rest);
  ~Stream() { end(); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  bool read(SampleBlock& block) { return queue_.take(block); }
  bool interlock_closed() const { return interlock_closed_; }
  // Ends it if it runs; the output stays where it is.
  Rest end();

 private:
  struct Trouble {
    BlockStatus status = BlockStatus::ok;
    std::string message;
  };
  Trouble silent() const;
  Trouble blocked() const;
  static Trouble trouble_of(LinkStatus status, const std::string& what);

  void prepare();
  void arm();
  void expect_silence();
  void run();
  void loop();
  void turn();
  void collect(std::chrono::milliseconds timeout);
  void take(const Transfers::Done& done);
  void feed();
  void look();
  void judge(const UnitStatus& status);
  void vouch(bool final);
  bool complete() const;
  void fail(Trouble trouble);
  void finish();
  void halt();

  Unit& unit_;
  Transfers& transfers_;
  const Inputs& inputs_;
  StreamPlan plan_;
  OutputFeed::ToCode to_code_;
  HostClock& clock_;
  OutputFeed feed_;
  TickCutter cutter_;
  Watch watch_;
  PaceWatch pace_watch_;
  BlockQueue queue_;

  std::size_t packet_samples_ = 0;
  std::uint64_t lead_ = 0;       // ticks of output in advance
  std::uint64_t chunk_ = 0;      // ticks of output in a transfer
  std::uint64_t delivered_ = 0;  // output ticks that the unit has taken
  std::uint64_t watched_ = 0;    // input ticks that the watch has seen
  std::uint64_t vouched_ = 0;    // of these, handed on or dropped between rows
  std::chrono::nanoseconds packet_time_{};
  HostClock::TimePoint heard_, looked_;
  // Whether the computer has left the unit without a transfer since the last look at its flags.
  bool input_late_ = false, output_late_ = false;
  std::optional<Trouble> trouble_;
  std::vector<Transfers::Done> done_;
  Rest rest_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> interlock_closed_{true};
  std::thread thread_;
};

}  // namespace ferrobench::daq::usb
