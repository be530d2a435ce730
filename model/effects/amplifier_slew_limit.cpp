#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

class SlewLimit final : public DriveStage {
 public:
  explicit SlewLimit(double rate) : rate_(rate) {}
  void start(double field) override { field_ = field; }

  void transform(const FieldPiece& in, std::vector<FieldPiece>& out) override {
    const double slope = (in.to - in.from) / in.duration;
    const auto go = [&](double duration, double to) {
      if (duration > 0) out.push_back({duration, field_, to});
      field_ = to;
    };
    double done = 0;
    const double behind = in.from - field_;
    if (behind != 0) {
      const double speed = std::copysign(rate_, behind);
      const double closing = (speed - slope) * std::copysign(1.0, behind);
      const double meeting = closing > 0 ? std::abs(behind) / closing : in.duration;
      if (meeting >= in.duration) return go(in.duration, field_ + speed * in.duration);
      done = meeting;
      go(done, in.from + slope * done);
    }
    const double left = in.duration - done;
    std::abs(slope) <= rate_ ? go(left, in.to) : go(left, field_ + std::copysign(rate_, slope) * left);
  }

 private:
  double rate_;
  double field_ = 0;
};

}  // namespace

Effect effect_amplifier_slew_limit() {
  return {.id = "amplifier_slew_limit",
          .equation = "|E_mon'| <= rate",
          .family = Family::drive,
          .parameters = {{"rate", "V/m/s", 1e5, 1e10, Sign::off_at_infinity, LimitOf::field_rate}},
          .shows = "field against command on ramps faster than the limit; all channels follow",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.drive.push_back(std::make_unique<SlewLimit>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects
