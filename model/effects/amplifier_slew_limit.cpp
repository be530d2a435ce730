#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

template <class T>
class SlewLimit final : public DriveStage<T> {
 public:
  explicit SlewLimit(T rate) : rate_(rate) {}
  T start(const T& field) override { return field_ = field; }

  void transform(const FieldPieceOf<T>& in, std::vector<FieldPieceOf<T>>& out) override {
    const T slope = (in.to - in.from) / in.duration;
    const auto go = [&](const T& duration, const T& to) {
      if (duration > 0) out.push_back({duration, field_, to});
      field_ = to;
    };
    T done = 0;
    const T behind = in.from - field_;
    if (behind != 0) {
      const T speed = copysign(rate_, behind);
      const T closing = (speed - slope) * copysign(T(1), behind);
      const T meeting = closing > 0 ? abs(behind) / closing : in.duration;
      if (meeting >= in.duration) return go(in.duration, field_ + speed * in.duration);
      done = meeting;
      go(done, in.from + slope * done);
    }
    const T left = in.duration - done;
    abs(slope) <= rate_ ? go(left, in.to) : go(left, field_ + copysign(rate_, slope) * left);
  }

 private:
  T rate_;
  T field_ = 0;
};

}  // namespace

Effect effect_amplifier_slew_limit() {
  return {.id = "amplifier_slew_limit",
          .equation = "|E_mon'| <= rate",
          .family = Family::drive,
          .parameters = {{"rate", "V/m/s", 1e5, 1e10, Sign::off_at_infinity, LimitOf::field_rate}},
          .shows = "field against command on ramps faster than the limit; all channels follow",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.drive.push_back(std::make_unique<SlewLimit<T>>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects
