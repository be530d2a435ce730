#include "tests/bench/peer_cvode.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "model/physics/kernel.h"

namespace ferrobench::bench {
namespace {

void need(int result) {
  if (result < 0) throw std::runtime_error("CVODE failed: " + std::to_string(result));
}

class System {
 public:
  explicit System(const Creep& creep)
      : material_(creep.model.material),
        constants_(model::kinetic_constants(creep.model.material)),
        size_(creep.domains.size()),
        prestress_(creep.model.load.prestress) {
    const auto& a = creep.model.actuator;
    stress_per_strain_ = creep.model.load.spring_stiffness * a.length / a.area;
    const auto column = [&](const std::vector<double>& from) {
      auto out = from;
      out.resize(size_ + model::DomainColumns::padding, from.back());
      return out;
    };
    barrier_ = inverse_barrier_ = column(creep.domains.barrier);
    for (auto& b : inverse_barrier_) b = 1 / b;
    field_ = column(creep.domains.field);
    stress_ = column(creep.domains.stress);
    weight_ = column(creep.domains.weight);
    for (auto& v : rates_) v.resize(barrier_.size());
  }

  std::size_t size() const { return size_; }
  sunindextype unknowns() const { return static_cast<sunindextype>(2 * size_ + 2); }
  sunindextype nonzeros() const { return static_cast<sunindextype>(12 * size_ + 4); }
  double weight(std::size_t i) const { return weight_[i]; }
  void set_piece(const CreepPiece& piece) { piece_ = &piece; }
  double field(double t) const { return piece_->from + piece_->slope() * (t - piece_->start); }

  // Equilibrium with the spring (rigid passive layers), and its change with <x+> and <x->.
  double stress(double e, double plus, double minus, std::array<double, 2>* slope = nullptr) const {
    const auto& m = material_;
    const double ninety = 1 - plus - minus, k = stress_per_strain_;
    const double compliance = m.compliance_180 + (m.compliance_90 - m.compliance_180) * ninety;
    const double strain = m.piezoelectric_180 * (plus - minus) * e + m.remanent_strain_90 * ninety +
                          m.compliance_180 * prestress_;
    const double out = (-prestress_ - k * strain) / (1 + k * compliance);
    if (slope != nullptr) {
      const double softer = m.compliance_180 - m.compliance_90;
      for (std::size_t i = 0; i < 2; ++i) {
        const double piezo = (i == 0 ? 1 : -1) * m.piezoelectric_180 * e;
        (*slope).at(i) = -k * (piezo - m.remanent_strain_90 + out * softer) / (1 + k * compliance);
      }
    }
    return out;
  }

  void rates(const model::Loads& at) {
    model::RateColumns columns;
    for (std::size_t j = 0; j < 4; ++j) {
      columns.log_rate.at(j) = rates_.at(j).data();
      columns.rate.at(j) = rates_.at(4 + j).data();
    }
    model::evaluate_rates(constants_,
                          {barrier_.data(), inverse_barrier_.data(), field_.data(), stress_.data(),
                           weight_.data(), nullptr, nullptr},
                          size_, at, columns);
  }

  void slope(double t, const double* y, double* out) {
    const double e = field(t);
    rates({e, stress(e, y[2 * size_], y[2 * size_ + 1])});
    const double per_tau = 1 / material_.relaxation_time;
    const double *a = rates_[4].data(), *b = rates_[5].data(), *c = rates_[6].data(), *d = rates_[7].data();
    const double* w = weight_.data();
    double plus = 0, minus = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double ninety = 1 - y[2 * i] - y[2 * i + 1];
      out[2 * i] = per_tau * (b[i] * ninety - a[i] * y[2 * i]);
      out[2 * i + 1] = per_tau * (c[i] * ninety - d[i] * y[2 * i + 1]);
      plus += w[i] * out[2 * i];
      minus += w[i] * out[2 * i + 1];
    }
    out[2 * size_] = plus;
    out[2 * size_ + 1] = minus;
  }

  // By columns: of each domain its 2x2 block and the means' rows, then the two columns of the means.
  void jacobian(double t, const double* y, SUNMatrix matrix) {
    auto* pointer = SM_INDEXPTRS_S(matrix);
    auto* row = SM_INDEXVALS_S(matrix);
    auto* value = SM_DATA_S(matrix);
    const double e = field(t);
    std::array<double, 2> stress_slope{};
    const double s = stress(e, y[2 * size_], y[2 * size_ + 1], &stress_slope);
    rates({e, s});
    const double per_tau = 1 / material_.relaxation_time;
    const auto plus_row = static_cast<sunindextype>(2 * size_), minus_row = plus_row + 1;
    sunindextype n = 0, column = 0;
    const auto put = [&](sunindextype at, double v) {
      row[n] = at;
      value[n++] = v;
    };
    by_stress_.resize(2 * size_ + 2);
    by_stress_[2 * size_] = by_stress_[2 * size_ + 1] = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double a = per_tau * rates_[4][i], b = per_tau * rates_[5][i], c = per_tau * rates_[6][i],
                   d = per_tau * rates_[7][i], w = weight_[i];
      const auto first = static_cast<sunindextype>(2 * i);
      pointer[column++] = n;
      put(first, -a - b);
      put(first + 1, -c);
      put(plus_row, w * (-a - b));
      put(minus_row, -w * c);
      pointer[column++] = n;
      put(first, -b);
      put(first + 1, -c - d);
      put(plus_row, -w * b);
      put(minus_row, w * (-c - d));

      const double ninety = 1 - y[2 * i] - y[2 * i + 1], seen_e = e + field_[i], seen_s = s + stress_[i];
      const auto force = model::driving_forces(constants_, {seen_e, seen_s});
      const double even = -2 * constants_.half_compliance * seen_s + constants_.strain_90;
      const double odd = constants_.piezoelectric * seen_e, beta = constants_.inverse_energy;
      const auto bent = [&](double f) {  // d ln(rate) / d force
        return beta * std::min(1.0, std::max(0.0, 0.5 - f * inverse_barrier_[i] / 8));
      };
      const double by_plus = even - odd, by_minus = even + odd;
      by_stress_[2 * i] =
          -b * bent(-force.plus_90) * by_plus * ninety - a * bent(force.plus_90) * by_plus * y[2 * i];
      by_stress_[2 * i + 1] =
          -c * bent(-force.minus_90) * by_minus * ninety - d * bent(force.minus_90) * by_minus * y[2 * i + 1];
      by_stress_[2 * size_] += w * by_stress_[2 * i];
      by_stress_[2 * size_ + 1] += w * by_stress_[2 * i + 1];
    }
    for (const double by_mean : stress_slope) {
      pointer[column++] = n;
      if (stress_per_strain_ == 0) {  // without a spring only the diagonal stays
        put(column - 1, 0);
        continue;
      }
      for (std::size_t i = 0; i < by_stress_.size(); ++i)
        put(static_cast<sunindextype>(i), by_mean * by_stress_[i]);
    }
    pointer[column] = n;
  }

 private:
  model::Material material_;
  model::KineticConstants constants_;
  std::size_t size_;
  double prestress_, stress_per_strain_;
  const CreepPiece* piece_ = nullptr;
  std::vector<double> barrier_, inverse_barrier_, field_, stress_, weight_, by_stress_;
  std::array<std::vector<double>, 8> rates_;  // four ln(tau r), four tau r
};

int slope(double t, N_Vector y, N_Vector out, void* system) {
  static_cast<System*>(system)->slope(t, NV_DATA_S(y), NV_DATA_S(out));
  return 0;
}
int jacobian(double t, N_Vector y, N_Vector, SUNMatrix matrix, void* system, N_Vector, N_Vector, N_Vector) {
  static_cast<System*>(system)->jacobian(t, NV_DATA_S(y), matrix);
  return 0;
}

}  // namespace

Outputs run_cvode(const Creep& creep, const PeerOptions& options) {
  System system(creep);
  SUNContext context = nullptr;
  need(SUNContext_Create(nullptr, &context));
  N_Vector y = N_VNew_Serial(system.unknowns(), context);
  for (sunindextype i = 0; i < system.unknowns(); ++i) NV_Ith_S(y, i) = i % 2 == 0 ? 1 : 0;
  SUNMatrix matrix =
      SUNSparseMatrix(system.unknowns(), system.unknowns(), system.nonzeros(), CSC_MAT, context);
  SUNLinearSolver solver = SUNLinSol_KLU(y, matrix, context);
  void* cvode = CVodeCreate(CV_BDF, context);
  system.set_piece(creep.pieces.front());
  need(CVodeInit(cvode, slope, 0, y));
  need(CVodeSStolerances(cvode, options.relative, options.absolute));
  need(CVodeSetUserData(cvode, &system));
  need(CVodeSetLinearSolver(cvode, solver, matrix));
  need(CVodeSetJacFn(cvode, jacobian));
  need(CVodeSetMaxNumSteps(cvode, 10'000'000));
  Outputs out;
  for (const auto& piece : creep.pieces) {
    system.set_piece(piece);
    const double end = piece.start + piece.duration;
    if (piece.start > 0) need(CVodeReInit(cvode, piece.start, y));
    need(CVodeSetStopTime(cvode, end));
    double reached = piece.start;
    const auto go = [&](double to) { need(CVode(cvode, to, y, &reached, CV_NORMAL)); };
    for (const double t : piece.times) {
      go(t);
      const double plus = NV_Ith_S(y, system.unknowns() - 2), minus = NV_Ith_S(y, system.unknowns() - 1);
      const double e = system.field(t), s = system.stress(e, plus, minus);
      out.stress.push_back(s);
      out.polarization.push_back(polarization(creep.model.material, e, s, plus, minus));
    }
    if (reached < end) go(end);
  }
  CVodeFree(&cvode);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return out;
}

}  // namespace ferrobench::bench
