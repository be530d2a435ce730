// Real runs in a child process that is killed at a random moment, and what recovery makes of them. Each run
// is one of the virtual device whose every sample is known from a run that was left alone, so no sample can
// be lost or invented unseen.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::faults {

struct KillFigures {
  int kills = 0;
  std::array<int, 5> outcomes{};  // by recordings::Recovered
  int before_any_file = 0, after_the_end = 0;
  std::uint64_t rows_acknowledged = 0, rows_recovered = 0;
  double greatest_loss =
      0;  // s, of what the device had measured by the clock when a run in real time was killed
  std::vector<std::string> failures;
};
std::ostream& operator<<(std::ostream& out, const KillFigures& figures);

// `kills` kills, every other one of a run in real time; the recovered files stay in `folder`, which is
// emptied first.
KillFigures kill_runs(int kills, std::uint64_t seed, const std::filesystem::path& folder);

// Opens every file of the folder with h5py. -1 if there is no h5py here, else how many opened; failures are
// added.
int open_with_h5py(const std::filesystem::path& folder, std::vector<std::string>& failures);

}  // namespace ferrobench::faults
