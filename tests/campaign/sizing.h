// How strong to make a hidden effect: so that its rms, over the noise, where it shows most, is what was
// drawn.
#pragma once

#include <array>
#include <vector>

#include "model/effects/catalogue.h"
#include "tests/campaign/draw.h"
#include "tests/campaign/programs.h"
#include "tests/campaign/twin.h"

namespace ferrobench::campaign {

// One bench's programs, played with a few domains and every fourth sample.
class Sizing {
 public:
  Sizing(const model::Model& base, const std::vector<FieldProgram>& programs);
  // Peak to peak over all recordings: field, charge, displacement, force.
  std::array<double, 4> ranges() const;
  // Largest of rms(with - without) / noise over channels and recordings; infinite if the twin gives up.
  double size(const model::EffectSetting& effect, const std::array<double, 4>& noise) const;
  // The effect with its first parameter (within its range) of about this size; the others as drawn.
  model::EffectSetting sized(model::EffectSetting effect, const model::EffectParameter& first, double wanted,
                             const std::array<double, 4>& noise, double* reached) const;

 private:
  std::vector<Response> play_all(const std::vector<model::EffectSetting>& effects) const;

  model::Model base_;
  std::vector<FieldProgram> programs_;
  std::vector<Response> without_;
};

// What the bench's base model is under this program's load.
model::Model loaded(const model::Model& base, const FieldProgram& program);

}  // namespace ferrobench::campaign
