#include "model/effects/empirical.h"

namespace ferrobench::model::effects {
namespace {

// All is piecewise linear in time where the input is: pieces end at the knots of f and where a play begins to
// move. At rest is at no field, so that an offset of the field, which has a name, is not in u.
template <class T>
class EmpiricalDrive final : public DriveStage<T> {
 public:
  explicit EmpiricalDrive(Values<T> values) : added_(values) {}

  T start(const T& field) override {
    added_.start();
    return last_ = output(field);
  }

  void transform(const FieldPieceOf<T>& in, std::vector<FieldPieceOf<T>>& out) override {
    T done = 0;
    for (const T& share : splits(in)) {
      go((share - done) * in.duration, in.from + share * (in.to - in.from), out);
      done = share;
    }
    go((1 - done) * in.duration, in.to, out);
  }

 private:
  // Where in the piece the output bends, as shares of its duration. An amplitude of nothing leaves the pieces
  // as they are.
  std::vector<T> splits(const FieldPieceOf<T>& in) const {
    if (added_.amplitude() == 0 || in.from == in.to) return {};
    std::vector<T> bends;
    const T from = in.from / added_.scale(), change = (in.to - in.from) / added_.scale();
    const auto meet = [&](const T& e) { bends.push_back((e - from) / change); };
    for (std::size_t i = 0; i < field_knots; ++i) meet(-1 + 2.0 * static_cast<double>(i) / (field_knots - 1));
    for (std::size_t j = 0; j < play_radii.size(); ++j)
      meet(added_.plays()[j] + (change > 0 ? play_radii[j] : -play_radii[j]));
    std::sort(bends.begin(), bends.end());
    // A piece of next to no length would only cost a step.
    constexpr double least = 1e-9;
    std::vector<T> out;
    for (const T& share : bends)
      if (share - (out.empty() ? T(0) : out.back()) > least && 1 - share > least) out.push_back(share);
    return out;
  }

  void go(const T& duration, const T& field, std::vector<FieldPieceOf<T>>& out) {
    const T to = output(field);
    out.push_back({duration, last_, to});
    last_ = to;
  }

  T output(const T& field) {
    const T out = field + added_.propose(field);
    added_.accept(field);
    return out;
  }

  EmpiricalOperator<T> added_;
  T last_ = 0;
};

}  // namespace

Effect effect_empirical_drive() {
  return {.id = "empirical_drive",
          .equation =
              "E_mon = E_cmd + u, an empirical table of the field and its past (empirical.h), fitted "
              "and not physics",
          .family = Family::drive,
          .parameters = empirical_parameters({"amplitude", "V/m", 1e3, 1e6},
                                             {"field_scale", "V/m", 1e5, 1e7, Sign::above_zero}, field_table),
          .shows = "field against command; all channels follow; stands for what has no name",
          .install =
              []<class T>(Values<T> v, ModelOf<T>&, PortsOf<T>& ports) {
                ports.drive.push_back(std::make_unique<EmpiricalDrive<T>>(v));
              },
          .empirical = true,
          .table = true};
}

}  // namespace ferrobench::model::effects
