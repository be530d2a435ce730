// The name of what is missing: effects that the screen suggests are refitted together with everything else,
// compared, and accepted only if nothing that the catalogue or plain functions of the signals could explain
// is left afterwards.
#pragma once

#include <optional>

#include "model/discrepancy/screen.h"

namespace ferrobench::model::discrepancy {

// An explanation that was tried: the base model with these effects.
struct Trial {
  std::vector<const Effect*> effects;
  Fit fit;
  double drop = 0;             // of the sum of squares against the base model's fit
  bool begun = false;          // a few steps were made
  bool polished = false;       // fitted to the end
  double numerical_error = 0;  // of the fine simulation there, rms over the noise
  // What is left: the largest drop that one more effect, or functions of the signals, would bring.
  bool checked = false;
  double left = 0;
};

struct NamingOptions {
  std::vector<const Effect*> candidates;
  double detect = 0;         // a smaller drop is nothing
  double second = 0;         // a smaller drop by a second effect is nothing
  double small_against = 0;  // likewise, as a share of the first one's
  bool few = false;          // numbers: they cannot tell two effects, and many starts fit them by chance
  int most_domains = 0;      // of the fine simulation
  bool doubt_base = false;   // the base fit may have ended elsewhere than at its minimum
  // What anything that is no effect would still take off the sum of squares; absent: not asked.
  std::function<double(const Fit&)> beyond_effects;
  std::function<void(const std::string& stage, double fraction)> tick;
};

struct Naming {
  std::vector<Screened> screened;  // around the base fit
  std::vector<Trial> trials;       // best first: sufficient ones before the others
  bool detected = false;
  double excess = 0;  // of the base fit's sum of squares over their number
  double left = 0;    // if nothing was detected: what functions of the signals would still take off it
  // A better fit of the base model that came up: nothing else is told then, all is to be asked again from it.
  std::optional<Fit> better_base;
};

// The noise's level is estimated to a few percent, so its square may be off by twice that.
inline constexpr double plain_excess = 0.2;
// Whether the base fit leaves something that is no noise, whatever it is.
bool leaves_something(const Naming& naming, const NamingOptions& options);
// What may be left after an explanation that brought this drop: nothing detectable, or what is small against
// it (two programs that agree to a few parts in ten thousand).
double allowed_left(const NamingOptions& options, double drop);
// What an explanation's numbers take off the sum of squares by chance, and more: they must earn it.
double price(const std::vector<const Effect*>& effects, double samples);
double score(const Trial& trial, double samples);

// `fine` is the same misfit with a simulation whose error does not show: fits that are judged are corrected
// by it, and it is refined where they want that.
Naming find_names(const Misfit& misfit, Misfit& fine, const Fit& base, const NamingOptions& options);

}  // namespace ferrobench::model::discrepancy
