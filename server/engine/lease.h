// One controller at a time. While nobody holds the lease, every client may control; while somebody does, only
// they may. It runs out unless renewed, so a client that dies does not lock the bench; if its holder wants
// so, the run under way is stopped then.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "base/fields.h"
#include "server/rpc/method.h"

namespace ferrobench::server {

struct LeaseStatus {
  std::string lease{};
  std::string holder{};
  double expires_in = 0;  // s
};
template <class Visitor>
void describe(Visitor& visit, LeaseStatus& s) {
  visit("lease", s.lease, {.doc = "to renew, release, or present it; only its holder is told"});
  visit("holder", s.holder, {.doc = "\"\" if nobody holds it"});
  visit("expires_in_s", s.expires_in, {.unit = "s"});
}

class Lease {
 public:
  // The caller holds it from now on. Error(not_controller) if another one does.
  // `stop_run`: see lost().
  LeaseStatus acquire(CallContext& caller, double seconds, bool stop_run = false);
  // The caller has it as well from now on; how long it lasts stays as it is.
  LeaseStatus present(CallContext& caller, const std::string& lease);
  // `lease` "": the one the caller presented. A new connection may renew an old one's lease, and has it then.
  LeaseStatus renew(CallContext& caller, const std::string& lease, double seconds);
  void release(CallContext& caller, const std::string& lease);
  LeaseStatus status() const;  // without the lease itself
  // Why a run must not go on: the lease ran out, neither renewed nor released, and was asked for with
  // `stop_run`. Else "".
  std::string lost() const;
  // For a new run: a lease that ran out before it has lost() nothing.
  void forget_lost();

  // The gate of the dispatcher: Error(not_controller) unless the caller may control now.
  void demand(const Method& method, const CallContext& caller) const;

 private:
  using Clock = std::chrono::steady_clock;
  bool held() const { return !token_.empty() && Clock::now() < end_; }
  LeaseStatus tell(bool with_token) const;
  void demand_token(const std::string& given) const;

  mutable std::mutex mutex_;
  std::string token_, holder_;
  bool stop_run_ = false;
  Clock::time_point end_;
};

}  // namespace ferrobench::server
