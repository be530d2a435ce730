#include "daq/usb/pace_watch.h"

#include <nlohmann/json.hpp>

namespace ferrobench::daq::usb {

std::string PaceWatch::check(std::uint64_t ticks, HostClock::TimePoint now) {
  const double passed = std::chrono::duration<double>(now - begin_).count();
  const double due = (static_cast<double>(ticks) - 1) / rate_;  // the first comes at once
  if (first_ < 0) first_ = passed;
  while (!arrivals_.empty() && arrivals_.back().lag >= passed - due) arrivals_.pop_back();
  arrivals_.push_back({passed, passed - due});
  while (arrivals_.front().time < passed - window) arrivals_.pop_front();

  const double least = arrivals_.front().lag;
  const char* how = -least > early + share * passed                              ? "fast"
                    : passed - first_ >= window && least > late + share * passed ? "slow"
                                                                                 : nullptr;
  if (how == nullptr) return {};
  return "the unit's pacer runs " + std::string(how) + ": " + std::to_string(ticks) + " ticks came in " +
         nlohmann::json(passed).dump() + " s, they are " + nlohmann::json(due).dump() + " s long";
}

}  // namespace ferrobench::daq::usb
