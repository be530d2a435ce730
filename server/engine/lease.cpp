#include "server/engine/lease.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "server/net/token.h"

namespace ferrobench::server {

namespace {

Error refused(const std::string& holder, double seconds) {
  return {
      ErrorCode::not_controller, "another client controls the bench",
      Problem{.message = "held by " + holder + " for another " + std::to_string(std::lround(seconds)) + " s",
              .hint =
                  "viewing stays possible; to control, present the lease if it is yours (--lease), or wait "
                  "until it is released or runs out"}};
}

}  // namespace

LeaseStatus Lease::tell(bool with_token) const {
  if (!held()) return {};
  const std::chrono::duration<double> left = end_ - Clock::now();
  return {with_token ? token_ : "", holder_, left.count()};
}

LeaseStatus Lease::acquire(CallContext& caller, double seconds, bool stop_run) {
  const std::scoped_lock lock(mutex_);
  if (held() && !equal_secret(caller.lease, token_)) throw refused(holder_, tell(false).expires_in);
  if (!held()) token_ = to_string(boost::uuids::random_generator()());
  holder_ = caller.client;
  stop_run_ = stop_run;
  caller.lease = token_;
  end_ = Clock::now() + std::chrono::milliseconds(std::lround(seconds * 1e3));
  return tell(true);
}

void Lease::demand_token(const std::string& given) const {
  if (held() && equal_secret(given, token_)) return;
  throw Error(ErrorCode::not_controller, "this lease is not in force",
              Problem{.path = "/lease",
                      .message = held() ? "is not the one in force" : "has run out or was released",
                      .hint = "lease.acquire a new one"});
}

LeaseStatus Lease::present(CallContext& caller, const std::string& lease) {
  const std::scoped_lock lock(mutex_);
  demand_token(lease);
  caller.lease = token_;
  return tell(true);
}

LeaseStatus Lease::renew(CallContext& caller, const std::string& lease, double seconds) {
  const std::scoped_lock lock(mutex_);
  demand_token(lease.empty() ? caller.lease : lease);
  holder_ = caller.client;
  caller.lease = token_;
  end_ = Clock::now() + std::chrono::milliseconds(std::lround(seconds * 1e3));
  return tell(true);
}

void Lease::release(CallContext& caller, const std::string& lease) {
  const std::scoped_lock lock(mutex_);
  demand_token(lease.empty() ? caller.lease : lease);
  token_.clear();
  caller.lease.clear();
}

LeaseStatus Lease::status() const {
  const std::scoped_lock lock(mutex_);
  return tell(false);
}

std::string Lease::lost() const {
  const std::scoped_lock lock(mutex_);
  if (!stop_run_ || token_.empty() || held()) return "";
  return "lost its controller: the lease of " + holder_ + " ran out";
}

void Lease::forget_lost() {
  const std::scoped_lock lock(mutex_);
  if (!held()) token_.clear();
}

void Lease::demand(const Method&, const CallContext& caller) const {
  const std::scoped_lock lock(mutex_);
  if (held() && !equal_secret(caller.lease, token_)) throw refused(holder_, tell(false).expires_in);
}

}  // namespace ferrobench::server
