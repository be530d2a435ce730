#include "daq/usb/pace_watch.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace ferrobench::daq::usb {

std::string PaceWatch::check(std::uint64_t ticks, HostClock::TimePoint now, bool final) {
  const double passed = std::chrono::duration<double>(now - begin_).count();
  const double due = (static_cast<double>(ticks) - 1) / rate_;  // the first comes at once
  least_lag_ = std::min(least_lag_, passed - due);
  const auto deviates = [&](const char* how) {
    return "the unit's pacer runs " + std::string(how) + ": " + std::to_string(ticks) + " ticks in " +
           nlohmann::json(passed).dump() + " s instead of " + nlohmann::json(due).dump() + " s";
  };
  if (-least_lag_ > early + share * passed) return deviates("fast");
  if (!final && passed < window_end_) return {};
  // A run's last window may be too short to have seen the host in time.
  const double lag = final ? std::min(least_lag_, lag_before_) : least_lag_;
  if (std::isfinite(lag) && lag > late + share * passed) return deviates("slow");
  window_end_ = passed + window;
  lag_before_ = least_lag_;
  least_lag_ = std::numeric_limits<double>::infinity();
  return {};
}

}  // namespace ferrobench::daq::usb
