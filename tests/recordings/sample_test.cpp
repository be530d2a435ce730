#include "tests/recordings/sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace ferrobench::recordings::testing {

TemporaryFolder::TemporaryFolder() {
  auto name = (std::filesystem::temp_directory_path() / "ferrobench-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

Header sample_header() {
  Header h;
  h.title = "a test";
  h.start_time = "2026-01-01T00:00:00.000000Z";
  h.entry_identifier = "0d6ac1fe-0000-4000-8000-000000000001";
  h.run_seed = 7;
  h.protocol = {{"format", "ferrobench-protocol"}};
  h.device = {{"driver", "test"}};
  h.specimen = {"a stack", 0.01, 2.5e-5, 1e-4, 100};
  h.load = {2.7e6, 8e6};
  return h;
}

Recording play(double start, const std::vector<Step>& steps, double rate) {
  Recording r;
  r.header = sample_header();
  auto& command = r.set(Channel::command);
  r.time.push_back(0);
  command.push_back(start);
  double level = start;
  for (const auto& step : steps) {
    const auto count = std::llround(step.seconds * rate);
    const auto first = static_cast<std::int64_t>(r.time.size()) - 1;
    for (std::int64_t i = 1; i <= count; ++i) {
      r.time.push_back(static_cast<double>(first + i) / rate);
      command.push_back(level + (step.level - level) * static_cast<double>(i) / static_cast<double>(count));
    }
    const bool hold = step.level == level;
    r.segments.push_back({first, first + count, hold ? "hold" : "ramp",
                          (hold ? "hold " : "ramp ") + std::to_string(r.segments.size()), step.level,
                          std::abs(step.level - level) / step.seconds});
    level = step.level;
  }
  r.set(Channel::field) = command;
  return r;
}

}  // namespace ferrobench::recordings::testing
