// A simulated bench: the model that is handed to the workflow, the recordings, and what is hidden in them.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "model/inference/study/discover.h"

namespace ferrobench::campaign {

enum class Kind { single, pair, nothing, moved, outside, withheld, coloured, physics };
std::span<const std::pair<Kind, std::string_view>> enum_names(Kind);
std::string_view kind_name(Kind kind);
Kind kind_named(std::string_view name);  // Error(invalid_params) with those that there are

struct Bench {
  std::uint64_t seed = 0;
  int index = 0;
  Kind kind = Kind::nothing;
  bool coloured = false;
  model::Model handed;                        // what the workflow gets
  model::Model base;                          // what made the recordings, without the hidden effects
  std::vector<model::EffectSetting> effects;  // hidden
  std::vector<double> sizes;                  // rms over noise, of each where it shows most
  std::vector<model::EffectSetting> physics;  // that is not the model's, in every recording
  double left = 0;                            // of it after recalibration, likewise
  std::vector<std::string> families;
  std::vector<std::string> candidates;  // that may be named; empty: all
  std::map<recordings::Channel, double> noise, gain, offset;
  std::vector<protocols::Past> pasts;  // of the recordings, as it was, if it was another than poled
  std::vector<model::NamedRecording> recordings;
};

// Where the noise is low, so many times the domains: 16,384 are 2e-5 to 2e-4 of the range off (root mean
// square), which is the noise itself.
inline constexpr int quiet_domains = 4;

struct BenchOptions {
  int domains = 16384;          // four times as many where the noise is low (`quiet_domains`)
  double commanded = 0.85;      // share of the benches whose recordings hold the command
  bool low_noise = false;       // 0.01 to 0.02 % of the range, 16 bits, in place of 0.1 to 0.5 %
  bool few_recordings = false;  // the slow loops and two others
  bool past = false;            // a specimen that is not poled towards +; half of the benches say so
  bool charge_only = false;     // field and charge of a free specimen: no spring, no prestress
};

// The same seed, index and kind always give the same bench.
Bench make_bench(std::uint64_t seed, int index, Kind kind, const BenchOptions& options = {});
// The kind that bench `index` of a mixed campaign has.
Kind kind_of(int index);

nlohmann::json truth_of(const Bench& bench);
// model.json, truth.json and a recording each in `folder`, which is made.
void write_bench(const Bench& bench, const std::string& folder);
// What is hidden in it, as write_bench() wrote it: all that an answer is judged by.
Bench read_truth(const std::string& folder);
// Also the model that is handed over and the recordings: all that is asked.
Bench read_bench(const std::string& folder);
// Of its folder, beside those of the other benches.
std::string name_of(int index);

}  // namespace ferrobench::campaign
