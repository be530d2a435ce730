// Outputs that may not be at zero though no run of this program has them: what a run of a program that died
// had left up, and could not be brought down. The bench's status says so until the unit was opened, which
// brings it to zero.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace ferrobench::server {

class Hazards {
 public:
  // `unit`: its serial number.
  void add(const std::string& unit, const std::string& warning) {
    const std::scoped_lock lock(mutex_);
    warnings_[unit] = warning;
  }
  void resolve(const std::string& unit) {
    const std::scoped_lock lock(mutex_);
    warnings_.erase(unit);
  }
  std::string text() const {  // "": none
    const std::scoped_lock lock(mutex_);
    std::string out;
    for (const auto& [unit, warning] : warnings_) out += (out.empty() ? "" : "; ") + warning;
    return out;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, std::string> warnings_;
};

}  // namespace ferrobench::server
