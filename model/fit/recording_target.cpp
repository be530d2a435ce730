#include <algorithm>
#include <cmath>

#include "model/fit/fit.h"
#include "model/on_recording.h"
#include "recordings/skew.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
constexpr std::array<Channel, 3> fitted{Channel::charge, Channel::displacement, Channel::force};
constexpr std::size_t most_rows = 2000;  // of each channel that take part

// A channel of a recording, where it was measured.
struct Part {
  const recordings::Recording* recording = nullptr;
  Channel channel = Channel::displacement;
  std::vector<std::size_t> rows;
  double scale = 1;  // residual = miss / scale, so that their root sum of squares is percent of the range

  std::string name() const {
    return recording->header.title + ", " + std::string(recordings::channel_name(channel));
  }
};

class RecordingTarget final : public FitTarget {
 public:
  explicit RecordingTarget(std::vector<recordings::Recording> given) : recordings_(std::move(given)) {
    for (const auto& r : recordings_)
      for (const auto channel : fitted)
        if (r.has(channel)) add({.recording = &r, .channel = channel, .rows = {}});
    if (parts_.empty()) {
      std::vector<Problem> problems;
      for (const auto& sentence : unused_) problems.push_back({.path = "/recordings", .message = sentence});
      throw Error(
          ErrorCode::bad_recording,
          "the recordings have nothing to fit to: none of charge, displacement and force was measured",
          std::move(problems));
    }
  }
  // Parts point into recordings_.
  RecordingTarget(const RecordingTarget&) = delete;
  RecordingTarget& operator=(const RecordingTarget&) = delete;

  std::size_t size() const override { return size_; }
  std::vector<std::string> unused() const override { return unused_; }

  void residuals(const Model& model, const SimulationOptions& options, std::span<double> out) const override {
    std::size_t next = 0;
    const recordings::Recording* played = nullptr;
    Trajectory simulated;
    for (const auto& part : parts_) {
      const auto& r = *part.recording;
      if (std::exchange(played, &r) != &r) simulated = simulate_on(model, r, options);
      const auto& measured = r.at(part.channel);
      const auto& answer = channel_of(simulated, part.channel);
      // Charge that was zeroed at its first sample says nothing of the absolute value.
      const bool relative = part.channel == Channel::charge &&
                            r.header.charge_reference == recordings::ChargeReference::first_sample;
      const auto first = part.rows.front();
      const double offset = relative ? answer[first] - measured[first] : 0;
      for (const auto i : part.rows) out[next++] = (answer[i] - offset - measured[i]) / part.scale;
    }
  }

  std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                      const SimulationOptions& options) const override {
    std::vector<double> all(size_);
    residuals(model, options, all);
    std::vector<std::pair<std::string, double>> out;
    std::size_t next = 0;
    for (const auto& part : parts_) {
      double sum = 0;
      for (std::size_t k = 0; k < part.rows.size(); ++k, ++next) sum += all[next] * all[next];
      out.emplace_back(part.name() + ", percent of range", std::sqrt(sum));
    }
    return out;
  }

 private:
  // A gap is no evidence: neither of the range nor of the model.
  void add(Part part) {
    const auto& measured = part.recording->at(part.channel);
    std::vector<std::size_t> known;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = 0; i < measured.size(); ++i) {
      if (!std::isfinite(measured[i])) continue;
      known.push_back(i);
      low = std::min(low, measured[i]);
      high = std::max(high, measured[i]);
    }
    if (!(high > low)) {
      unused_.push_back(part.name() + (known.empty() ? " has no finite value" : " never changes"));
      return;
    }
    const auto rows = std::min(most_rows, known.size());
    for (std::size_t k = 0; k < rows; ++k) part.rows.push_back(known[k * known.size() / rows]);
    part.scale = 0.01 * std::sqrt(static_cast<double>(rows)) * (high - low);
    size_ += rows;
    parts_.push_back(std::move(part));
  }

  std::vector<recordings::Recording> recordings_;
  std::vector<Part> parts_;  // by recording
  std::vector<std::string> unused_;
  std::size_t size_ = 0;
};

}  // namespace

std::unique_ptr<FitTarget> recording_target(std::vector<recordings::Recording> recordings) {
  for (auto& r : recordings) ferrobench::recordings::remove_skew(r);
  return std::make_unique<RecordingTarget>(std::move(recordings));
}

}  // namespace ferrobench::model
