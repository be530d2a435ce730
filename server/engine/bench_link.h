// The server's end of the connection to a bench: a process of its own, or a thread of this one for what holds
// no voltage (replays, and devices that a test brings along). Both are asked the same way.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "server/bench/channel.h"
#include "server/bench/host.h"
#include "server/bench/nudge.h"

namespace ferrobench::server {

// What comes from a run without being asked for. Called by the link's own thread; must not wait.
class RunWatcher {
 public:
  virtual ~RunWatcher() = default;
  virtual void status(const bench::RunState& state) = 0;
  virtual void event(const bench::Noted& event) = 0;
  virtual void closed(const bench::Closed& closed) = 0;
  virtual void lost(const std::string& why) = 0;  // the bench has died; nothing comes any more
};

class BenchLink {
 public:
  // Throw Error(device_unavailable).
  static std::shared_ptr<BenchLink> to_process();
  static std::shared_ptr<BenchLink> to_thread(bench::Opener open);
  // A bench that its server has left, at this socket. Null if nobody answers there as one does.
  static std::shared_ptr<BenchLink> taken_over(const std::string& path);
  ~BenchLink();  // ends the bench, safely
  BenchLink(const BenchLink&) = delete;
  BenchLink& operator=(const BenchLink&) = delete;

  // The reply. Throws what the bench throws, Error(device_lost) if it has died, and Error(device_unavailable)
  // if the device does not answer it within `patience`: it may be held up in the kernel for ever.
  template <class Answer, class M>
  Answer ask(M message, std::optional<std::chrono::seconds> patience = {}) {
    return bench::decoded<Answer>(reply_to(std::move(message), patience));
  }
  template <class M>
  void order(M message) {
    reply_to(std::move(message));
  }
  // For what a bench does at once, and must. A process that does not answer within 2 s hangs, and is ended:
  // its successor brings the output to zero. Throws Error(device_lost) then.
  template <class M>
  void order_at_once(M message) {
    message.call = ++last_call_;
    answer_at_once(message.call, bench::framed(message));
  }
  template <class M>
  void tell(const M& message, recordings::Descriptor file = {}) {
    post(bench::framed(message), std::move(file));
  }

  std::uint32_t new_number() { return ++last_number_; }  // of a device or a run
  // Null: no more; none is called when this returns. One that comes after the bench has died hears of it at
  // once.
  void watch(std::uint32_t run, RunWatcher* watcher);
  bool lost() const;
  const bench::Ready& ready() const { return ready_; }
  // Of the run that was taken over, with its lock. Once.
  recordings::Descriptor take_journal();
  // Of the bench in this process, else null.
  bench::Host* host() { return host_.get(); }
  // What is done once the bench has died, by the link's thread, after those who watch a run have heard of it:
  // why an output may not be at zero, or "".
  std::function<std::string()> when_lost{};
  // What that said, when it is done.
  std::string after_loss() const { return after_.get(); }

 private:
  struct Waiting {
    std::optional<bench::Reply> reply{};
  };

  BenchLink(recordings::Descriptor socket, pid_t process);
  bool await_ready();
  void start();
  template <class M>
  std::string reply_to(M message, std::optional<std::chrono::seconds> patience = {}) {
    message.call = ++last_call_;
    return answer_to(message.call, bench::framed(message), patience);
  }
  std::string answer_to(std::uint64_t call, std::string frame, std::optional<std::chrono::seconds> patience);
  void answer_at_once(std::uint64_t call, std::string frame);
  // None: it has not come within `patience`. Throws as ask().
  std::optional<std::string> await(std::uint64_t call, std::string frame,
                                   std::optional<std::chrono::seconds> patience);
  void post(std::string frame, recordings::Descriptor file);
  void listen();
  void take(const bench::Message& message);
  void die(const std::string& why);
  void see_it_dead() const;
  void see_it_leave() const;

  std::unique_ptr<bench::Host> host_;
  std::thread host_thread_;
  pid_t process_ = 0;
  bool child_ = true;  // of this process
  bench::Ready ready_{};
  bench::Nudge nudge_;
  std::atomic<std::uint64_t> last_call_ = 0;
  std::atomic<std::uint32_t> last_number_ = 0;

  mutable std::mutex mutex_;  // over what follows
  std::condition_variable changed_;
  bench::Channel channel_;
  std::map<std::uint64_t, Waiting> waiting_;
  bool leaving_ = false, hangs_ = false;
  std::string unfit_{};  // why the bench must be ended
  std::optional<std::string> lost_{};

  std::promise<std::string> loss_done_;
  std::shared_future<std::string> after_ = loss_done_.get_future().share();
  std::mutex watching_;  // held while a watcher is called
  std::map<std::uint32_t, RunWatcher*> watchers_;
  std::optional<std::string> loss_told_;  // to those who watched
  std::thread listener_;
};

}  // namespace ferrobench::server
