#include <algorithm>
#include <cmath>
#include <span>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/free_specimen.h"
#include "model/inference/residuals/residual_model.h"
#include "model/inference/residuals/separable.h"
#include "model/inference/residuals/simulated_rows.h"

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
  explicit RecordingResiduals(std::vector<RecordingData> given) : data_(std::move(given)) {
    for (const auto& d : data_) {
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
    const auto all = simulate_each_recorded(model, data_, fidelity);
    for (std::size_t i = 0; i < data_.size(); ++i) {
      const auto& d = data_[i];
      const auto& simulated = all[i];
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
  std::unique_ptr<ResidualModel> with_pasts(std::span<const protocols::Past> pasts) const override {
    auto out = std::make_unique<RecordingResiduals>(*this);
    for (std::size_t i = 0; i < pasts.size(); ++i) out->data_.at(i).past = pasts[i];
    return out;
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
  // A recording's own specimen and load stand in place of the model's, so these of the model's numbers do
  // nothing.
  static bool is_overridden(std::string_view path) {
    return path.starts_with("load.") ||
           (path.starts_with("actuator.") && path != "actuator.passive_stiffness");
  }

  Solved fill(const Model& model, const Fidelity& fidelity, const std::vector<FreeParameter>& by,
              std::span<double> out, Eigen::MatrixXd* slopes) const override {
    std::vector<std::string> moving;
    std::vector<Eigen::Index> column_of;
    for (std::size_t i = 0; i < by.size(); ++i)
      if (!is_overridden(by[i].path)) {
        moving.push_back(by[i].path);
        column_of.push_back(static_cast<Eigen::Index>(i));
      }
    std::size_t next = 0;
    const auto each = simulate_each_recorded(model, data_, fidelity, moving);
    for (std::size_t i = 0; i < data_.size(); ++i) {
      const auto& d = data_[i];
      const auto& simulated = each[i];
      if (!simulated) return Solved::no;
      for (const auto& column : d.columns) {
        const auto& answer = simulated->at(column.channel);
        const double mean = mean_of(answer, column.rows), scale = residual_scale(column);
        for (std::size_t k = 0; k < column.rows.size(); ++k)
          out[next + k] = scale * (answer[column.rows[k]] - mean - column.value[k]);
        for (std::size_t p = 0; slopes != nullptr && p < moving.size(); ++p) {
          const auto& all = simulated->slopes_at(column.channel);
          double sum = 0;
          for (const auto row : column.rows) sum += all[row * moving.size() + p];
          const double middle = sum / static_cast<double>(column.rows.size());
          for (std::size_t k = 0; k < column.rows.size(); ++k)
            (*slopes)(static_cast<Eigen::Index>(next + k), column_of[p]) =
                scale * (all[column.rows[k] * moving.size() + p] - middle);
        }
        next += column.rows.size();
      }
    }
    return Solved::yes;
  }

  std::vector<RecordingData> data_;
  std::vector<std::string> unused_;
};

}  // namespace

std::unique_ptr<ResidualModel> recording_residuals(std::vector<RecordingData> recordings) {
  return std::make_unique<RecordingResiduals>(std::move(recordings));
}

std::unique_ptr<ResidualModel> recording_residuals(std::vector<recordings::Recording> recordings) {
  std::vector<RecordingData> data;
  data.reserve(recordings.size());
  for (auto& r : recordings) data.push_back(prepare(std::move(r)));
  return recording_residuals(std::move(data));
}

}  // namespace ferrobench::model
