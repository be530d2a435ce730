// What the workflow said of a bench against what was hidden in it.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tests/campaign/bench.h"

namespace ferrobench::campaign {

struct Outcome {
  int index = 0;
  Kind kind = Kind::nothing;
  bool coloured = false;
  std::set<std::string> truth;  // ids; empty if nothing is hidden
  bool in_catalogue = true;     // all of them may be named
  double size = 0;              // of the largest
  double over_left = 0;         // the smallest over what another base physics leaves; 0 without either
  std::string verdict;          // or "error"
  std::string error;
  std::set<std::string> named;  // of the first explanation, if anything was named
  std::optional<std::string> family;
  bool family_right = false;
  bool class_right = false;              // right up to what the answer says it cannot tell apart
  double probability = 0;                // stated for the verdict: first explanation, unknown or nothing
  std::vector<double> parameter_errors;  // relative, of the effects that were named rightly
  int intervals = 0, holding = 0;        // of these effects, and how many hold the hidden value
  double before = 0, after = 0;          // residual over noise on the locked recordings, rms over channels
  double share_held_out = 0;             // of the mean square above noise there that the answer removes
  double seconds = 0;

  bool names() const { return verdict == "named" || verdict == "ambiguous"; }
  bool right() const;  // the answer that this bench asks for
  bool hit() const;    // at least one of the effects
  bool wrong_name() const;
};

// `found`: the answer as a batch keeps it, which holds no time.
Outcome score(const Bench& bench, const nlohmann::json& found);
Outcome score_error(const Bench& bench, const std::string& what);
std::string line_of(const Outcome& outcome);
nlohmann::json to_json(const Outcome& outcome);

}  // namespace ferrobench::campaign
