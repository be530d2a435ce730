#include <algorithm>
#include <cmath>

#include "model/fit/fit.h"
#include "model/on_recording.h"
#include "recordings/skew.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
constexpr std::array<Channel, 3> fitted{Channel::charge, Channel::displacement, Channel::force};
constexpr std::size_t most_rows = 2000;  // of each recording that take part

class RecordingTarget final : public FitTarget {
 public:
  explicit RecordingTarget(std::vector<recordings::Recording> given) : recordings_(std::move(given)) {
    for (const auto& r : recordings_)
      for (const auto channel : fitted)
        if (r.has(channel)) size_ += rows(r);
    if (size_ == 0)
      throw Error(ErrorCode::bad_recording,
                  "the recordings have none of the channels charge, displacement and force");
  }

  std::size_t size() const override { return size_; }

  void residuals(const Model& model, const SimulationOptions& options, std::span<double> out) const override {
    std::size_t next = 0;
    for (const auto& r : recordings_) {
      const auto simulated = simulate_on(model, r, options);
      for (const auto channel : fitted) {
        if (!r.has(channel)) continue;
        const auto& measured = r.at(channel);
        const auto& answer = channel_of(simulated, channel);
        const auto [low, high] = std::minmax_element(measured.begin(), measured.end());
        const double scale = std::sqrt(static_cast<double>(rows(r))) * std::max(*high - *low, 1e-300);
        // Charge that was zeroed at its first sample says nothing of the absolute value.
        const bool relative = channel == Channel::charge &&
                              r.header.charge_reference == recordings::ChargeReference::first_sample;
        const double offset = relative ? answer.front() - measured.front() : 0;
        for (std::size_t k = 0; k < rows(r); ++k) {
          const std::size_t i = k * r.size() / rows(r);
          const double miss = (answer[i] - offset - measured[i]) / scale;
          out[next++] = std::isfinite(miss) ? 100 * miss : 0;  // a gap is no evidence
        }
      }
    }
  }

  std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                      const SimulationOptions& options) const override {
    std::vector<double> all(size_);
    residuals(model, options, all);
    std::vector<std::pair<std::string, double>> out;
    std::size_t next = 0;
    for (const auto& r : recordings_)
      for (const auto channel : fitted) {
        if (!r.has(channel)) continue;
        double sum = 0;
        for (std::size_t k = 0; k < rows(r); ++k, ++next) sum += all[next] * all[next];
        out.emplace_back(r.header.title + ", " + std::string(channel_name(channel)) + ", percent of range",
                         std::sqrt(sum));
      }
    return out;
  }

 private:
  static std::size_t rows(const recordings::Recording& r) { return std::min(most_rows, r.size()); }

  std::vector<recordings::Recording> recordings_;
  std::size_t size_ = 0;
};

}  // namespace

std::unique_ptr<FitTarget> recording_target(std::vector<recordings::Recording> recordings) {
  for (auto& r : recordings) ferrobench::recordings::remove_skew(r);
  return std::make_unique<RecordingTarget>(std::move(recordings));
}

}  // namespace ferrobench::model
