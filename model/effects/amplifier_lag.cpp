#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"

namespace ferrobench::model::effects {
namespace {

// The exponential that follows a corner, as chords that grow as it decays. The ends of the chords are exact.
// Between them they are off by at most 1e-3 of the exponential's height, no more than 20 V/m as long as that
// takes fewer than some 220 chords (1e-5 of the height), and 0.5 V/m is never asked for more closely.
template <class T>
T chord_error(const T& height) {
  return std::max({1e-5 * height, std::min(T(20), 1e-3 * height), T(0.5)});
}

template <class T>
class AmplifierLag final : public DriveStage<T> {
 public:
  explicit AmplifierLag(T tau) : tau_(tau) {}
  T start(const T& field) override { return field_ = field; }

  void transform(const FieldPieceOf<T>& in, std::vector<FieldPieceOf<T>>& out) override {
    if (tau_ <= 0 || in.duration <= 0) {
      out.push_back(in);
      field_ = in.to;
      return;
    }
    const T slope = (in.to - in.from) / in.duration;
    const T height = field_ - in.from + slope * tau_;  // of the exponential over the line it decays to
    const T allowed = chord_error(abs(height));
    const auto at = [&](const T& t) { return in.from + slope * (t - tau_) + height * exp(-t / tau_); };
    T done = 0;
    while (done < in.duration) {
      const T left = abs(height) * exp(-done / tau_);
      T end = in.duration;
      if (left > allowed) end = std::min(end, done + tau_ * sqrt(8 * allowed / left));
      // A last chord of next to no length would only cost a step.
      if (in.duration - end < 1e-3 * tau_ || end <= done) end = in.duration;
      const T to = at(end);
      out.push_back({end - done, field_, to});
      field_ = to;
      done = end;
    }
  }

 private:
  T tau_;
  T field_ = 0;
};

}  // namespace

Effect effect_amplifier_lag() {
  return {.id = "amplifier_lag",
          .equation = "E_mon = lag(E_cmd)",
          .family = Family::drive,
          .parameters = {{"time_constant", "s", 1e-5, 1}},
          .shows = "field against command on ramps and after corners; all channels follow",
          .install = []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
            ports.drive.push_back(std::make_unique<AmplifierLag<T>>(v[0]));
          }};
}

}  // namespace ferrobench::model::effects
