// An engine in a folder of its own, and small programs for it.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "daq/registry.h"
#include "recordings/format/parts.h"
#include "server/engine/engine.h"

namespace ferrobench::server {

struct Folder {
  explicit Folder(const std::filesystem::path& within = std::filesystem::temp_directory_path()) {
    auto name = (within / "engine-XXXXXX").string();
    path = mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path); }
  std::filesystem::path path;
};

// Up to 0.5 kV/mm, a hold, and back to 0, all in s.
inline nlohmann::json trapezium(double ramp, double hold) {
  return {{"format", "ferrobench-protocol"},
          {"version", 1},
          {"name", "trapezium"},
          {"title", "Trapezium"},
          {"unit", "kV/mm"},
          {"sample_rate_Hz", 200},
          {"parameters", {{"top", 0.5}}},
          {"start", 0},
          {"segments",
           {{{"kind", "ramp"}, {"to", "$top"}, {"time", ramp}},
            {{"kind", "hold"}, {"time", hold}, {"label", "the hold"}},
            {{"kind", "ramp"}, {"to", 0}, {"time", ramp}}}}};
}

inline RunRequest request(const nlohmann::json& protocol, bool fast) {
  RunRequest out;
  out.protocol = protocol;
  out.model = "soft-pzt";
  out.fast = fast;
  return out;
}

class EngineTest : public testing::Test {
 protected:
  RunStatus finish(const RunRequest& r) { return engine.wait(engine.start(r).run); }
  // Until the run is in one of the states; fails after ten seconds.
  RunStatus await(std::initializer_list<RunState> states) {
    for (int i = 0; i < 2000; ++i) {
      const auto status = engine.status();
      if (std::ranges::count(states, status.state) > 0) return status;
      usleep(5000);
    }
    ADD_FAILURE() << "the run is " << write_json(engine.status().state);
    return engine.status();
  }

  Folder folder;
  Hub hub;
  Engine engine{folder.path, hub};
};

// The code of the Error that `act` throws; `internal` if it throws none.
template <class F>
ErrorCode code_of(F&& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::internal;
}

}  // namespace ferrobench::server
