// The end of the program at a time that was told, whatever still hangs: a disk, a driver, a long report.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace ferrobench::cli {

class Deadline {
 public:
  // Unless it goes before, says what `last_words` gives and ends the program, without destructors. Last words
  // that take more than a second are left out: they may want what hangs.
  Deadline(std::chrono::milliseconds time, std::function<std::string()> last_words);
  ~Deadline();
  Deadline(const Deadline&) = delete;
  Deadline& operator=(const Deadline&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace ferrobench::cli
