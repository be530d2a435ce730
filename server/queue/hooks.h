// Who is told at night: programs and web addresses of the daemon's owner, one an event, given at its start
// and never by a client. A program is called as PROGRAM EVENT JSON; an address gets {"event": EVENT, "facts":
// JSON} as a POST. One after the other, in a process with no descriptor of this one and no input, which is
// ended after 30 s. What becomes of it stops nothing.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

namespace ferrobench::server {

enum class HookEvent { run_ended, limit_tripped, queue_empty, queue_stopped };
std::span<const std::pair<HookEvent, std::string_view>> enum_names(HookEvent);

class Hooks {
 public:
  // `given`: EVENT=PROGRAM or EVENT=ADDRESS, http or https. Throws Error(invalid_params) for an event that
  // there is not, or a program that cannot be run. `complain` is told, by a thread of its own, which failed.
  explicit Hooks(const std::vector<std::string>& given, std::function<void(const std::string&)> complain);
  ~Hooks();  // what is under way is ended, what waits is not told any more
  Hooks(const Hooks&) = delete;
  Hooks& operator=(const Hooks&) = delete;

  // Waits for nothing. Where many wait already, the oldest is dropped.
  void tell(HookEvent event, const nlohmann::json& facts);

 private:
  struct Call {
    std::string to{}, event{}, facts{};
  };
  void work();
  std::string carry_out(const Call& call);

  std::map<std::string, std::string, std::less<>> told_;  // programs and addresses, by event
  std::function<void(const std::string&)> complain_;
  std::mutex mutex_;  // over what follows
  std::condition_variable changed_;
  std::deque<Call> waiting_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace ferrobench::server
