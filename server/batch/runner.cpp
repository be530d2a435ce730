#include "server/batch/runner.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <deque>
#include <memory>
#include <system_error>
#include <thread>

#include "recordings/disk/durable_file.h"
#include "recordings/process/child.h"

namespace ferrobench::batch {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

namespace {

constexpr int most_tries = 2;  // of an item whose process died

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

// Appended by single writes, so that lines of several writers stay whole.
class Log {
 public:
  Log(const BatchFolder& folder, const std::string& name)
      : path_((folder.logs() / name).string()),
        file_(recordings::Descriptor(open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666))) {}
  const recordings::Descriptor& descriptor() const { return file_; }
  // Nobody's result is worse for want of it.
  void add(const json& line) const {
    const auto text = line.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
    if (file_) (void)!write(file_.get(), text.data(), text.size());
  }

 private:
  std::string path_;
  recordings::Descriptor file_;
};

struct Running {
  Place place;
  int tries = 0;
  Clock::time_point begin = Clock::now();
  std::unique_ptr<recordings::Child> child;
};

std::string end_in_words(int status) {
  if (WIFSIGNALED(status))
    return "its process was ended by signal " + std::to_string(WTERMSIG(status)) + " (" +
           strsignal(WTERMSIG(status)) + ")";
  return "its process ended with exit code " + std::to_string(WEXITSTATUS(status)) + " and left no result";
}

class Runner {
 public:
  Runner(const BatchFolder& folder, Kind kind, const std::vector<Place>& places, const RunOptions& options)
      : folder_(folder), kind_(kind), options_(options), log_(folder, options.log) {
    for (const auto& place : places) {
      if (read_result(place.id, folder).is_null())
        waiting_.push_back({.place = place, .child = nullptr});
      else
        ++over_;
    }
  }

  bool run() {
    while (!waiting_.empty() || !running_.empty()) {
      if (options_.go_on && !options_.go_on(over_)) return false;
      while (!waiting_.empty() && running_.size() < static_cast<std::size_t>(std::max(1, options_.slots)))
        start();
      for (std::size_t i = 0; i < running_.size();)
        if (running_[i].child->over())
          finish(i);
        else
          ++i;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    if (options_.go_on) options_.go_on(over_);
    return true;
  }

 private:
  void start() {
    auto next = std::move(waiting_.front());
    waiting_.pop_front();
    const std::array<std::string, 9> words{"ferrobench",
                                           "batch",
                                           "work",
                                           folder_.path().string(),
                                           std::to_string(next.place.task),
                                           "--item",
                                           std::to_string(next.place.index),
                                           "--threads",
                                           std::to_string(options_.threads)};
    ++next.tries;
    next.begin = Clock::now();
    try {
      next.child =
          std::make_unique<recordings::Child>(words, -1, log_.descriptor() ? log_.descriptor().get() : -1);
    } catch (const std::system_error& failure) {
      throw Error(ErrorCode::io_error, "no process can be started for an item",
                  Problem{.message = failure.code().message(), .hint = "see how many processes are allowed"});
    }
    running_.push_back(std::move(next));
  }

  void finish(std::size_t at) {
    auto ended = std::move(running_[at]);
    running_.erase(running_.begin() + static_cast<std::ptrdiff_t>(at));
    const int status = ended.child->end();
    ended.child.reset();
    auto result = read_result(ended.place.id, folder_);
    if (result.is_null() && ended.tries < most_tries) {
      log_.add({{"item", ended.place.id}, {"host", host_}, {"state", "again: " + end_in_words(status)}});
      waiting_.push_front(std::move(ended));
      return;
    }
    if (result.is_null()) {
      const Error error(
          ErrorCode::internal, end_in_words(status),
          Problem{.hint = "log/" + options_.log +
                          " says more, unless the system had no memory left: give it fewer at a time"});
      put_failure(kind_, folder_.task(ended.place.task).at(ended.place.index), error, folder_);
    }
    ++over_;
    const std::chrono::duration<double> spent = Clock::now() - ended.begin;
    log_.add({{"item", ended.place.id},
              {"seconds", spent.count()},
              {"host", host_},
              {"state", result.is_null() ? json("failed") : result.at("state")}});
  }

  const BatchFolder& folder_;
  Kind kind_;
  const RunOptions& options_;
  Log log_;
  std::string host_ = host_name();
  std::deque<Running> waiting_;
  std::vector<Running> running_;
  std::size_t over_ = 0;
};

}  // namespace

bool run_items(const BatchFolder& folder, Kind kind, const std::vector<Place>& places,
               const RunOptions& options) {
  return Runner(folder, kind, places, options).run();
}

void work_on_item(const BatchFolder& folder, std::int64_t task, std::size_t index, int threads) {
  recordings::be_a_child();
  const auto plan = folder.plan();
  const auto items = folder.task(task);
  if (!plan || index >= items.size())
    throw Error(ErrorCode::not_found,
                "the batch has no item " + std::to_string(index) + " in task " + std::to_string(task));
  carry_out(plan->kind, items[index], threads, folder);
}

}  // namespace ferrobench::batch
