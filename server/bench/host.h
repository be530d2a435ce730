// The bench: the devices that are open, the runs and self-tests on them, and the connection to the server
// that asks for them.
//
// What it does, as a process of its own:
//
//   state        what goes on                          what leads out of it
//   served       what the server asks                  the server leaves: everything stops, the process ends;
//                                                      it dies: deserted; it says nothing for 5 s: unheard
//   unheard      the run stops safely, unless it is    the server speaks: served; dies: deserted
//                unattended; its messages wait
//   deserted     self-tests stop, devices without a    the next server comes: served;
//                run close; the run stops safely, or   the run is over: over
//                is finished if it is unattended
//   over         the journal is whole, the output at   the next server comes: served;
//                zero; it waits for 10 s               10 s pass, or nobody can come: the process ends
//
// Deserted and over, it listens at bench-PROCESS.sock (mode 0600) in the data folder, if it has a run of a
// daemon.
#pragma once

#include <condition_variable>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "server/bench/channel.h"
#include "server/bench/nudge.h"
#include "server/bench/run.h"

namespace ferrobench::bench {

using Opener =
    std::function<std::unique_ptr<daq::Device>(const std::string& driver, const nlohmann::json& config)>;

inline constexpr std::chrono::seconds silence_allowed{5};  // of the server, while a run goes on
inline constexpr std::chrono::seconds wait_for_next{10};   // for a server, after the run
inline constexpr std::string_view socket_prefix = "bench-", socket_suffix = ".sock";

class Host {
 public:
  // `process`: it is one of its own, and outlives the server. `lacks`: what it tells with Ready.
  Host(Descriptor server, Opener open, bool process, std::string lacks = "");
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  // Until the server leaves, or what its end leaves to do is done. Then every device is closed.
  void serve();

  // In the server's own process: a device that is there already, and one of those open (null: none).
  void add_device(std::uint32_t number, std::shared_ptr<daq::Device> device);
  std::shared_ptr<daq::Device> device(std::uint32_t number) const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Running {
    std::shared_ptr<Run> run{};
    bool unattended = false, told_closed = false;
    std::string folder{}, card{};
    Descriptor journal{};  // with its lock, until the server needs the run no more
    RunState told{};
    Clock::time_point told_at{};
  };
  struct Work {
    std::thread thread;
    std::atomic<bool> done = false;
  };

  // In the thread of serve().
  void hear();
  void take(const Message& message);
  void tell();
  void tell_of(std::uint32_t number, Running& running);
  void watch_server();
  void desert();
  void take_over();
  bool finished();
  void send(std::string frame) { server_->send(std::move(frame)); }
  void begin(const Begin& asked, Descriptor journal);
  Running& running(std::uint32_t number);
  // In a thread of its own, as it may take its time.
  void answer_later(std::uint64_t call, std::function<std::string()> act);
  void reap(bool wait);

  std::string open(const Open& asked);
  std::string close(const Close& asked);
  std::string selftest(const Selftest& asked);
  std::string prepare(const Prepare& asked);
  std::shared_ptr<daq::Device> demand_device(std::uint32_t number) const;

  Opener open_;
  bool process_;
  std::string lacks_;
  std::optional<Channel> server_;  // none: deserted
  Nudge nudge_;
  Descriptor door_;
  std::string door_path_;
  Clock::time_point heard_ = Clock::now();
  std::optional<Clock::time_point> over_since_;
  bool unheard_ = false, left_ = false;
  std::list<Work> works_;

  mutable std::mutex mutex_;  // over what follows
  std::map<std::uint32_t, std::shared_ptr<daq::Device>> devices_;
  std::map<std::uint32_t, Running> runs_;
  std::vector<std::string> replies_;  // frames
  std::string test_stop_;             // why self-tests must end
  int tests_ = 0;
  bool served_ = true;  // there is a server
};

}  // namespace ferrobench::bench
