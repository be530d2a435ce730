// What several effects are made of.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "model/physics/lag.h"
#include "model/physics/ports.h"

namespace ferrobench::model::effects {

// Error(bad_model) for the parametrized polycrystal, whose one domain has neither internal loads nor barriers
// to change.
inline void refuse_parametrized(const Model& model, const std::string& id) {
  if (model.polycrystal.method == PolycrystalMethod::parametrized)
    throw Error(ErrorCode::bad_model, "the effect " + id + " has no meaning for a parametrized polycrystal",
                Problem{.path = "/polycrystal/method",
                        .message = "does not go with " + id,
                        .given = "parametrized",
                        .allowed = {"none", "distribution"}});
}
// The model's distribution over domains; a single crystal becomes one that has no spread yet.
inline Polycrystal& domains_of(Model& model, const std::string& id) {
  refuse_parametrized(model, id);
  auto& p = model.polycrystal;
  if (p.method == PolycrystalMethod::none) {
    p = {};
    p.method = PolycrystalMethod::distribution;
  }
  return p;
}

// A sensor without memory.
class Memoryless final : public SensorStage {
 public:
  explicit Memoryless(std::function<double(const SensorInput&)> function) : function_(std::move(function)) {}
  void start(const SensorInput&) override {}
  double update(const SensorInput& in) override { return function_(in); }

 private:
  std::function<double(const SensorInput&)> function_;
};
inline std::unique_ptr<SensorStage> memoryless(std::function<double(const SensorInput&)> function) {
  return std::make_unique<Memoryless>(std::move(function));
}

// lag_tau of the value, starting in equilibrium.
class LagStage final : public SensorStage {
 public:
  explicit LagStage(double tau) : tau_(tau) {}
  void start(const SensorInput& in) override {
    last_ = in;
    value_ = in.value;
  }
  double update(const SensorInput& in) override {
    value_ = lag(value_, last_.value, in.value, in.time - last_.time, tau_);
    last_ = in;
    return value_;
  }

 private:
  double tau_;
  SensorInput last_;
  double value_ = 0;
};

// lag_tau of something of the material, starting at zero as if that had been zero until then.
class DelayedStrain final : public StrainTerm {
 public:
  DelayedStrain(double tau, std::function<double(const MaterialState&)> input)
      : tau_(tau), input_(std::move(input)) {}
  void start(const MaterialState&) override { value_ = last_input_ = 0; }
  double propose(double h, const MaterialState& end) const override {
    return lag(value_, last_input_, input_(end), h, tau_);
  }
  void accept(double h, const MaterialState& end) override {
    value_ = propose(h, end);
    last_input_ = input_(end);
  }

 private:
  double tau_;
  std::function<double(const MaterialState&)> input_;
  double value_ = 0, last_input_ = 0;
};

}  // namespace ferrobench::model::effects
