#include "server/engine/jobs.h"

#include <array>
#include <thread>

#include "base/priority.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::server {

namespace {
constexpr std::size_t most_running = 4, most_jobs = 100;
}

std::span<const std::pair<JobState, std::string_view>> enum_names(JobState) {
  static constexpr std::array<std::pair<JobState, std::string_view>, 4> names{
      {{JobState::running, "running"},
       {JobState::complete, "complete"},
       {JobState::failed, "failed"},
       {JobState::cancelled, "cancelled"}}};
  return names;
}

std::string moment_in(std::optional<double> seconds) {
  return seconds ? recordings::iso_after(recordings::iso_now(), *seconds).value_or("") : "";
}

void Jobs::Handle::say(double progress, const std::string& stage) {
  {
    const std::scoped_lock lock(mutex_);
    status_.progress = progress;
    status_.stage = stage;
    if (progress > 0) {
      const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin_;
      status_.time_left = spent.count() * (1 - progress) / progress;
      status_.estimated_end = moment_in(status_.time_left);
    }
  }
  changed_();
}

void Jobs::Handle::check() const {
  if (cancelled_) throw Error(ErrorCode::cancelled, "the job was cancelled");
}

struct Jobs::Job {
  Handle handle;
  std::jthread thread;
};

Jobs::~Jobs() {
  for (auto& [id, job] : jobs_) job->handle.cancelled_ = true;
  for (auto& [id, job] : jobs_)
    if (job->thread.joinable()) job->thread.join();
}

std::string Jobs::start(const std::string& kind, Work work) {
  const std::scoped_lock lock(mutex_);
  const auto running = std::ranges::count_if(jobs_, [](const auto& entry) {
    const std::scoped_lock inner(entry.second->handle.mutex_);
    return entry.second->handle.status_.state == JobState::running;
  });
  if (static_cast<std::size_t>(running) >= most_running)
    throw Error(
        ErrorCode::busy, "as many jobs as there is room for are under way",
        Problem{.given = running, .allowed = most_running, .hint = "wait for one, or stop it: job.cancel"});
  forget_old();
  auto job = std::make_shared<Job>();
  auto& handle = job->handle;
  auto id = "job-" + std::to_string(++last_);
  handle.status_ = {.job = id, .kind = kind, .stage = "starting"};
  handle.changed_ = [this, &handle] {
    JobStatus copy;
    {
      const std::scoped_lock inner(handle.mutex_);
      copy = handle.status_;
    }
    hub_.publish("job", write_json(copy));
  };
  jobs_[last_] = job;
  job->thread = std::jthread([&handle, work = std::move(work)] {
    give_way();
    JobState state = JobState::complete;
    nlohmann::json result, error;
    try {
      result = work(handle);
      if (handle.stopped_) state = JobState::cancelled;
    } catch (const Error& failure) {
      state = failure.code() == ErrorCode::cancelled ? JobState::cancelled : JobState::failed;
      error = failure.data();
      error["message"] = failure.message();
    } catch (const std::exception& failure) {
      state = JobState::failed;
      error = {{"name", "internal"}, {"message", failure.what()}, {"problems", nlohmann::json::array()}};
    }
    {
      const std::scoped_lock inner(handle.mutex_);
      auto& s = handle.status_;
      s.state = state;
      if (state == JobState::complete) s.progress = 1;
      s.stage = "over";
      s.time_left.reset();
      s.estimated_end.clear();
      s.result = std::move(result);
      s.error = std::move(error);
    }
    handle.changed_();
  });
  return id;
}

void Jobs::forget_old() {
  for (auto at = jobs_.begin(); jobs_.size() >= most_jobs && at != jobs_.end();) {
    std::unique_lock inner(at->second->handle.mutex_);
    const bool over = at->second->handle.status_.state != JobState::running;
    inner.unlock();
    at = over ? jobs_.erase(at) : std::next(at);
  }
}

std::shared_ptr<Jobs::Job> Jobs::find(const std::string& id) const {
  const std::scoped_lock lock(mutex_);
  for (const auto& [number, job] : jobs_)
    if (job->handle.status_.job == id) return job;
  return nullptr;
}

bool Jobs::knows(const std::string& id) const {
  return find(id) != nullptr;
}

JobStatus Jobs::status(const std::string& id) const {
  const auto job = find(id);
  if (!job)
    throw Error(ErrorCode::not_found, "there is no such job",
                Problem{.path = "/job", .given = excerpt(id), .hint = "job.list names them"});
  const std::scoped_lock lock(job->handle.mutex_);
  return job->handle.status_;
}

std::vector<JobStatus> Jobs::list() const {
  const std::scoped_lock lock(mutex_);
  std::vector<JobStatus> out;
  out.reserve(jobs_.size());
  for (const auto& [number, job] : jobs_) {
    const std::scoped_lock inner(job->handle.mutex_);
    out.push_back(job->handle.status_);
  }
  std::ranges::reverse(out);
  return out;
}

void Jobs::cancel(const std::string& id) {
  status(id);
  if (const auto job = find(id)) job->handle.cancelled_ = true;
}

}  // namespace ferrobench::server
