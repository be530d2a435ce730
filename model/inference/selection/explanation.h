// What model selection tells: verdict, explanations with their probabilities, what would decide between two.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::model {

enum class Verdict { named, ambiguous, unknown, nothing_missing };
std::span<const std::pair<Verdict, std::string_view>> enum_names(Verdict);

struct EffectEstimate {
  struct Parameter {
    std::string name;
    double value = 0;          // SI
    double low = 0, high = 0;  // 90 % interval
  };
  std::string id;
  std::vector<Parameter> parameters;
};

// Each recording that was learned from, predicted from the others (selection/leave_one_out.h).
struct LeaveOneOut {
  std::size_t recordings = 0, better = 0;  // than by the base model
  double gain = 0;                         // of the sum of squares over all of them
};

struct Explanation {
  std::vector<EffectEstimate> effects;
  double probability = 0;
  std::optional<LeaveOneOut> leave_one_out;
};

struct NextExperiment {
  std::string protocol;      // name in the protocol library
  double expected_odds = 0;  // of the better explanation against the other, after it
};

// What is missing, where no effect explains it: what would have to be added to a channel, without an offset.
struct MissingSignal {
  std::string recording;
  recordings::Channel channel = recordings::Channel::displacement;
  std::vector<double> time, value;  // SI
};

}  // namespace ferrobench::model
