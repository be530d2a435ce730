#include "server/cli/deadline.h"

#include <unistd.h>

#include <future>
#include <iostream>
#include <memory>

#include "server/cli/cli.h"

namespace ferrobench::cli {

namespace {

std::string said_within_a_second(const std::function<std::string()>& words) {
  auto told = std::make_shared<std::promise<std::string>>();
  auto text = told->get_future();
  std::thread([told, words] { told->set_value(words()); }).detach();
  return text.wait_for(std::chrono::seconds(1)) == std::future_status::ready
             ? text.get()
             : "the bench does not answer: the output may not be at zero, switch the amplifier off";
}

}  // namespace

Deadline::Deadline(std::chrono::milliseconds time, std::function<std::string()> last_words)
    : thread_([this, time, last_words = std::move(last_words)] {
        std::unique_lock lock(mutex_);
        if (changed_.wait_for(lock, time, [this] { return over_; })) return;
        std::cerr << "ferrobench: " << said_within_a_second(last_words) << std::endl;
        _exit(exit_error);
      }) {}

Deadline::~Deadline() {
  {
    const std::scoped_lock lock(mutex_);
    over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

}  // namespace ferrobench::cli
