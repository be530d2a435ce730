#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// The exponential that follows a corner, as chords that grow as it decays. The ends of the chords are exact.
// Between them they are off by at most 1e-3 of the exponential's height, no more than 20 V/m as long as that
// takes fewer than some 220 chords (1e-5 of the height), and 0.5 V/m is never asked for more closely.
double chord_error(double height) {
  return std::max({1e-5 * height, std::min(20.0, 1e-3 * height), 0.5});
}

class AmplifierLag final : public DriveStage {
 public:
  explicit AmplifierLag(double tau) : tau_(tau) {}
  void start(double field) override { field_ = field; }

  void transform(const FieldPiece& in, std::vector<FieldPiece>& out) override {
    if (tau_ <= 0 || in.duration <= 0) {
      out.push_back(in);
      field_ = in.to;
      return;
    }
    const double slope = (in.to - in.from) / in.duration;
    const double height = field_ - in.from + slope * tau_;  // of the exponential over the line it decays to
    const double allowed = chord_error(std::abs(height));
    const auto at = [&](double t) { return in.from + slope * (t - tau_) + height * std::exp(-t / tau_); };
    double done = 0;
    while (done < in.duration) {
      const double left = std::abs(height) * std::exp(-done / tau_);
      double end = in.duration;
      if (left > allowed) end = std::min(end, done + tau_ * std::sqrt(8 * allowed / left));
      // A last chord of next to no length would only cost a step.
      if (in.duration - end < 1e-3 * tau_ || end <= done) end = in.duration;
      const double to = at(end);
      out.push_back({end - done, field_, to});
      field_ = to;
      done = end;
    }
  }

 private:
  double tau_;
  double field_ = 0;
};

}  // namespace

Effect effect_amplifier_lag() {
  return {.id = "amplifier_lag",
          .equation = "E_mon = lag(E_cmd)",
          .family = Family::drive,
          .parameters = {{"time_constant", "s", 1e-5, 1}},
          .shows = "field against command on ramps and after corners; all channels follow",
          .install = [](std::span<const double> v, Model&, Ports& ports) {
            ports.drive.push_back(std::make_unique<AmplifierLag>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects
