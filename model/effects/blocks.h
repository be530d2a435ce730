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
template <class T>
void refuse_parametrized(const ModelOf<T>& model, const std::string& id) {
  if (model.polycrystal.method == PolycrystalMethod::parametrized)
    throw Error(ErrorCode::bad_model, "the effect " + id + " has no meaning for a parametrized polycrystal",
                Problem{.path = "/polycrystal/method",
                        .message = "does not go with " + id,
                        .given = "parametrized",
                        .allowed = {"none", "distribution"}});
}
// The model's distribution over domains; a single crystal becomes one that has no spread yet.
template <class T>
PolycrystalOf<T>& domains_of(ModelOf<T>& model, const std::string& id) {
  refuse_parametrized(model, id);
  auto& p = model.polycrystal;
  if (p.method == PolycrystalMethod::none) {
    p = {};
    p.method = PolycrystalMethod::distribution;
  }
  return p;
}

// A sensor without memory.
template <class T>
class Memoryless final : public SensorStage<T> {
 public:
  explicit Memoryless(std::function<T(const SensorInput<T>&)> function) : function_(std::move(function)) {}
  void start(const SensorInput<T>&) override {}
  T update(const SensorInput<T>& in) override { return function_(in); }

 private:
  std::function<T(const SensorInput<T>&)> function_;
};
template <class T>
std::unique_ptr<SensorStage<T>> memoryless(std::function<T(const SensorInput<T>&)> function) {
  return std::make_unique<Memoryless<T>>(std::move(function));
}

// lag_tau of the value, starting in equilibrium.
template <class T>
class LagStage final : public SensorStage<T> {
 public:
  explicit LagStage(T tau) : tau_(tau) {}
  void start(const SensorInput<T>& in) override {
    last_ = in;
    value_ = in.value;
  }
  T update(const SensorInput<T>& in) override {
    value_ = lag(value_, last_.value, in.value, in.time - last_.time, tau_);
    last_ = in;
    return value_;
  }

 private:
  T tau_;
  SensorInput<T> last_;
  T value_ = 0;
};

// A term of the polarization without memory.
template <class T>
class ByField final : public MaterialTerm<T> {
 public:
  explicit ByField(std::function<T(const T& field)> function) : function_(std::move(function)) {}
  void start(const MaterialState<T>&) override {}
  T propose(const T&, const MaterialState<T>& end) const override { return function_(end.field); }
  void accept(const T&, const MaterialState<T>&) override {}

 private:
  std::function<T(const T&)> function_;
};

// lag_tau of something of the material, starting at zero as if that had been zero until then.
template <class T>
class DelayedStrain final : public MaterialTerm<T> {
 public:
  DelayedStrain(T tau, std::function<T(const MaterialState<T>&)> input)
      : tau_(tau), input_(std::move(input)) {}
  void start(const MaterialState<T>&) override { value_ = last_input_ = T(0); }
  T propose(const T& h, const MaterialState<T>& end) const override {
    return lag(value_, last_input_, input_(end), h, tau_);
  }
  void accept(const T& h, const MaterialState<T>& end) override {
    value_ = propose(h, end);
    last_input_ = input_(end);
  }

 private:
  T tau_;
  std::function<T(const MaterialState<T>&)> input_;
  T value_ = 0, last_input_ = 0;
};

}  // namespace ferrobench::model::effects
