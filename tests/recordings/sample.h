// Recordings made in memory for the tests, and a folder that is gone afterwards.
#pragma once

#include <filesystem>
#include <string>

#include "recordings/format/recording.h"

namespace ferrobench::recordings::testing {

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// One hundred layers of 0.1 mm, 25 mm^2; spring 2.7 N/um, prestress 8 MPa.
Header sample_header();

// A program of ramps and holds at `rate` samples a second: levels [V/m] and the time [s] to get to each (a
// level equal to the one before is a hold). Command and field follow it exactly; the segment table comes with
// it.
struct Step {
  double level;
  double seconds;
};
Recording play(double start, const std::vector<Step>& steps, double rate);

}  // namespace ferrobench::recordings::testing
