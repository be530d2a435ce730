// The numbers that a fit moves, on scales where 0 is what the given model says and 1 is one standard
// deviation of what is known beforehand.
//
//   base parameters, effects that the model has already:   ln(value / given) = 0.12 z       (12 %;
//     0.5 z once the model is wrong by much and nothing was named: widen_priors)
//   factors on each recording's spring and prestress:      ln(factor) = 0.05 z
//   gains of the channels:                                 ln(gain) = 0.03 z
//   offset of the field, where it is the drive:            offset = 0.03 range z
//   the effect that is tried:                              no prior
//
// z ends at 12 for the model and at 5 for the instrument: gains, offset, spring and prestress.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/dataset/bench.h"

namespace ferrobench::model::inference {

// Whether a parameter is the model's: not an instrument's ("gain.charge", "offset.field") or the load's
// ("factor.prestress").
bool is_of_model(std::string_view path);

struct ScaledParameter {
  std::string path;  // as in parameters.h, or "gain.charge", "factor.prestress"
  double from = 0;   // the value at z = 0
  double scale = 1;  // of ln(value) if logarithmic, else of the value
  bool logarithmic = true;
  bool prior = true;
  double low = 0, high = 0;  // of z

  double value(double z) const;
  double slope(double z) const;  // d value / dz
  bool of_model() const;
};

// A model with the numbers that may move in it.
struct Hypothesis {
  Model model;
  std::vector<ScaledParameter> parameters;
  std::size_t base_count = 0;  // the first ones are the base model's
  double reach = 30;           // an effect's amplitude may be so many times what is plausible
};

// Where nothing has moved.
Eigen::VectorXd prior_mean(const Hypothesis& hypothesis);
// Where `z` of `from` stands, in the parameters of `to`; those that it lacks stand at their prior mean.
Eigen::VectorXd carried_over(const Hypothesis& to, const Hypothesis& from, const Eigen::VectorXd& z);

struct Setting {
  Model model;
  std::array<double, compared_channels.size()> gain{1, 1, 1, 1};  // by compared_channels
  double spring_factor = 1, prestress_factor = 1;
  double field_offset = 0;  // of the measured field
};
Setting setting_at(const Hypothesis& hypothesis, const Eigen::VectorXd& z);
// The same; empty where no model can have these numbers.
std::optional<Setting> possible_setting(const Hypothesis& hypothesis, const Eigen::VectorXd& z);
// The recording with the load that the setting says it had, and, where no command was recorded, the drive
// that its measured field says: measured = gain * field + offset.
BenchRecording apply_setting(const Setting& setting, const BenchRecording& recording);

// The base model: material, polycrystal, passive layers and effects that it has, factors and gains.
Hypothesis base_hypothesis(const Model& model, const std::vector<BenchRecording>& bench);

// In a model that is wrong by much, the base's numbers make up for what it lacks, and what they were says
// less of what they have to be: they are known to 50 %, at the place where they stand and within the same
// ranges.
void widen_priors(Hypothesis& hypothesis, Eigen::VectorXd& z);

// With one more effect, standing at these values of its parameters; its parameters are the last ones.
Hypothesis with_effect(const Hypothesis& hypothesis, const Effect& effect, const std::vector<double>& values);

// Without one of the model's effects and its parameters.
Hypothesis without_effect(Hypothesis hypothesis, const std::string& id);

// How an effect's amplitude is moved from very weak to very strong.
struct Amplitude {
  explicit Amplitude(const EffectParameter& parameter);
  double weak = 0, strong = 0;  // the plausible range
  bool off_at_infinity = false, any_sign = false;
  // `strength` is proportional to what the effect does while it is small.
  double value(double strength) const { return off_at_infinity ? 1 / strength : strength; }
  double strength(double value) const { return off_at_infinity ? 1 / value : value; }
};

}  // namespace ferrobench::model::inference
