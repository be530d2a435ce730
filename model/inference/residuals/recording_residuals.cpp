#include <algorithm>
#include <cmath>
#include <span>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/free_specimen.h"
#include "model/inference/residuals/residual_model.h"
#include "model/inference/residuals/separable.h"
#include "model/on_recording.h"

namespace ferrobench::model {
namespace {

double mean_of(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
  double sum = 0;
  for (const auto row : rows) sum += values[row];
  return sum / static_cast<double>(rows.size());
}

[[noreturn]] void throw_unsolvable() {
  throw Error(ErrorCode::numerical, "the model cannot be simulated under these recordings");
}

class RecordingResiduals final : public ResidualModel {
 public:
  explicit RecordingResiduals(std::vector<recordings::Recording> given) {
    for (auto& r : given) {
      data_.push_back(prepare(std::move(r)));
      const auto& d = data_.back();
      for (const auto& column : d.columns) {
        parts_.push_back({d.header.title + ", " + std::string(recordings::channel_name(column.channel)),
                          size_, column.rows.size()});
        size_ += column.rows.size();
      }
      unused_.insert(unused_.end(), d.unused.begin(), d.unused.end());
    }
    if (!parts_.empty()) return;
    std::vector<Problem> problems;
    for (const auto& sentence : unused_) problems.push_back({.path = "/recordings", .message = sentence});
    throw Error(ErrorCode::bad_recording,
                "the recordings have nothing to fit to: none of charge, displacement and force was measured",
                std::move(problems));
  }

  std::vector<ComparedCurve> curves(const Model& model, const Fidelity& fidelity) const override {
    std::vector<ComparedCurve> out;
    for (const auto& d : data_) {
      const auto simulated = simulate_recorded(model_for(model, d.header), d, fidelity);
      if (!simulated) throw_unsolvable();
      for (const auto& column : d.columns) {
        auto& curve = out.emplace_back();
        curve.recording = d.header.title;
        curve.channel = column.channel;
        curve.measured = column.value;
        const auto& answer = simulated->at(column.channel);
        const double mean = mean_of(answer, column.rows);
        for (const auto row : column.rows) {
          curve.time.push_back(d.time[row]);
          curve.field.push_back(simulated->field[row]);
          curve.simulated.push_back(answer[row] - mean);
        }
      }
    }
    return out;
  }

  std::vector<std::string> unused() const override { return unused_; }
  std::span<const RecordingData> recordings() const override { return data_; }

  Solved evaluate(const Model& model, const Fidelity& fidelity, std::span<double> out) const override {
    std::size_t next = 0;
    for (const auto& d : data_) {
      const auto simulated = simulate_recorded(model_for(model, d.header), d, fidelity);
      if (!simulated) return Solved::no;
      for (const auto& column : d.columns) {
        const auto& answer = simulated->at(column.channel);
        const double mean = mean_of(answer, column.rows);
        const double scale = residual_scale(column);
        for (std::size_t k = 0; k < column.rows.size(); ++k)
          out[next++] = scale * (answer[column.rows[k]] - mean - column.value[k]);
      }
    }
    return std::ranges::all_of(out, [](double r) { return std::isfinite(r); }) ? Solved::yes : Solved::no;
  }

  std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                      const Fidelity& fidelity) const override {
    std::vector<double> all(size_);
    if (evaluate(model, fidelity, all) == Solved::no) throw_unsolvable();
    std::vector<std::pair<std::string, double>> out;
    for (const auto& part : parts_) {
      const auto rows = std::span<const double>(all).subspan(part.first, part.count);
      out.emplace_back(part.name + ", percent of range", std::sqrt(sum_of_squares(rows)));
    }
    return out;
  }

  std::unique_ptr<Separable> separable(const Model& model,
                                       const std::vector<FreeParameter>& free) const override {
    return free_specimen(model, free, data_);
  }

 private:
  std::vector<RecordingData> data_;
  std::vector<std::string> unused_;
};

}  // namespace

std::unique_ptr<ResidualModel> recording_residuals(std::vector<recordings::Recording> recordings) {
  return std::make_unique<RecordingResiduals>(std::move(recordings));
}

}  // namespace ferrobench::model
