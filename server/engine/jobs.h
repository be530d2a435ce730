// Anything long that is not a run: it goes on in a thread of its own, and can be asked how far it is.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/fields.h"
#include "server/rpc/hub.h"

namespace ferrobench::server {

enum class JobState { running, complete, failed, cancelled };
std::span<const std::pair<JobState, std::string_view>> enum_names(JobState);

struct JobStatus {
  std::string job{}, kind{};
  JobState state = JobState::running;
  double progress = 0;
  std::string stage{};
  std::optional<double> time_left{};  // s
  std::string estimated_end{};
  nlohmann::json result{}, error{};
};
template <class Visitor>
void describe(Visitor& visit, JobStatus& s) {
  visit("job", s.job, {.required = true});
  visit("kind", s.kind, {.doc = "run, simulate, fit, discover or table"});
  visit("state", s.state, {.required = true});
  visit("progress", s.progress, {.min = 0, .max = 1});
  visit("stage", s.stage, {.doc = "what it is at"});
  visit("time_left_s", s.time_left, {.unit = "s", .doc = "estimated, while it runs"});
  visit("estimated_end", s.estimated_end, {.doc = "ISO 8601, while it runs and can be estimated"});
  visit("result", s.result, {.doc = "null until it is over; of a fit that was cancelled, the best so far"});
  visit("error", s.error, {.doc = "{name, message, problems} if it failed"});
}

// A time that far from now as ISO 8601; "" for none.
std::string moment_in(std::optional<double> seconds);

class Jobs {
 public:
  // What the work sees of its own job.
  class Handle {
   public:
    void say(double progress, const std::string& stage);
    bool cancelled() const { return cancelled_; }
    void check() const;  // throws Error(cancelled)
    // What the work returns is what it had when it was cancelled.
    void stopped() { stopped_ = true; }

   private:
    friend class Jobs;
    mutable std::mutex mutex_;
    JobStatus status_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    std::atomic<bool> cancelled_{false};
    bool stopped_ = false;
    std::function<void()> changed_;
  };
  using Work = std::function<nlohmann::json(Handle&)>;

  explicit Jobs(Hub& hub) : hub_(hub) {}
  ~Jobs();  // cancels all and waits

  // Error(busy) while as many jobs run as there are places.
  std::string start(const std::string& kind, Work work);
  bool knows(const std::string& id) const;
  JobStatus status(const std::string& id) const;  // Error(not_found)
  std::vector<JobStatus> list() const;            // newest first
  // The work stops where it next looks.
  void cancel(const std::string& id);

 private:
  struct Job;
  std::shared_ptr<Job> find(const std::string& id) const;
  void forget_old();

  Hub& hub_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, std::shared_ptr<Job>> jobs_;
  std::uint64_t last_ = 0;
};

}  // namespace ferrobench::server
