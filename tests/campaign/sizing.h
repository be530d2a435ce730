// How strong to make a hidden effect: so that its rms, over the noise, where it shows most, is what was
// drawn.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "model/effects/catalogue.h"
#include "tests/campaign/draw.h"
#include "tests/campaign/programs.h"
#include "tests/campaign/twin.h"

namespace ferrobench::campaign {

// Field, charge, displacement, force.
std::array<const std::vector<double>*, 4> columns(const Response& response);

// One bench's programs, played with a few domains and every fourth sample.
class Sizing {
 public:
  static constexpr int thinning = 4;
  // `channels`: of columns(), those that the bench measures.
  Sizing(const model::Model& base, const std::vector<FieldProgram>& programs,
         std::vector<std::size_t> channels);
  // Peak to peak over all recordings: field, charge, displacement, force.
  std::array<double, 4> ranges() const;
  // Largest of rms(with - without) / noise over channels and recordings; infinite if the twin gives up.
  double size(const model::EffectSetting& effect, const std::array<double, 4>& noise) const;
  std::vector<Response> play_all(const std::vector<model::EffectSetting>& effects) const {
    return play_all(base_, programs_, effects);
  }
  std::vector<Response> play_all(const model::Model& base, const std::vector<FieldProgram>& programs,
                                 const std::vector<model::EffectSetting>& effects) const;
  const model::Model& base() const { return base_; }
  const std::vector<FieldProgram>& programs() const { return programs_; }  // as played
  const std::vector<std::size_t>& channels() const { return channels_; }

 private:
  model::Model base_;
  std::vector<FieldProgram> programs_;
  std::vector<std::size_t> channels_;
  std::vector<Response> without_;
};

struct Sized {
  model::EffectSetting effect;
  double size = 0;
};
// The effect with its first parameter (within its range) such that `size` of it is about what is wanted; the
// others as given.
Sized sized(model::EffectSetting effect, const model::EffectParameter& first, double wanted,
            const std::function<double(const model::EffectSetting&)>& size, int tries = 12);

// What the bench's base model is under this program's load.
model::Model loaded(const model::Model& base, const FieldProgram& program);

}  // namespace ferrobench::campaign
