#include <deque>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// Keeps the inputs of the last `delay` seconds, linear in between. Inputs much closer together than the delay
// are thinned, which bounds the memory.
template <class T>
class Delay final : public SensorStage<T> {
 public:
  explicit Delay(T delay) : delay_(delay), spacing_(delay / 16384) {}
  void start(const SensorInput<T>& in) override { history_.assign(1, in); }
  T update(const SensorInput<T>& in) override {
    const bool close = history_.size() > 1 && in.time - history_[history_.size() - 2].time < spacing_;
    if (!close && in.time > history_.back().time)
      history_.push_back(in);
    else
      history_.back() = in;
    const T then = in.time - delay_;
    while (history_.size() > 1 && history_[1].time <= then) history_.pop_front();
    const auto& a = history_.front();
    if (history_.size() == 1 || then <= a.time) return a.value;
    const auto& b = history_[1];
    return a.value + (b.value - a.value) * (then - a.time) / (b.time - a.time);
  }

 private:
  T delay_, spacing_;
  std::deque<SensorInput<T>> history_;
};

}  // namespace

Effect effect_displacement_delay() {
  return {.id = "displacement_delay",
          .equation = "xm(t) = x(t - delay)",
          .family = Family::displacement_sensor,
          .parameters = {{"delay", "s", 1e-5, 0.5}},
          .shows = "displacement on fast ramps: loops open the same at each field; not in the force",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.displacement.push_back({SensorOrder::delay, std::make_unique<Delay<T>>(v[0])});
          }};
}

}  // namespace ferrobench::model::effects
